"""The paper: a cage of balls in a box, its field, the normals and the interior that follow from it."""
