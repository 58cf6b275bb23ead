"""Outward normals by Faraday cage estimation."""
