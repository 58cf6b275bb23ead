"""What the shell shows of stages, on a terminal and elsewhere."""

import io

from face_plugin.app.cli.progress import Progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_terminal_shows_the_stage_at_work_and_messages_above_it():
    stream = Terminal()
    shown = Progress(stream)
    shown.update("tiles", 0.0)
    shown.update("tiles", 0.5)
    shown.note("a warning")
    assert stream.getvalue().split("\n")[-2].split("\r")[-1] == "a warning"
    # The stage that was written over stands below again.
    assert stream.getvalue().endswith("\rtiles          50 %")
    shown.update("tiles", 1.0)
    assert stream.getvalue().split("\n")[-2].split("\r")[-1].split() == ["tiles", "0.0", "s"]
    assert stream.getvalue().endswith(" s\n")


def test_elsewhere_a_stage_is_written_once_it_is_done():
    stream = io.StringIO()
    shown = Progress(stream)
    for fraction in (0.0, 0.5, 1.0):
        shown.update("tiles", fraction)
    shown.close()
    assert stream.getvalue().split() == ["tiles", "0.0", "s"]
    assert "\r" not in stream.getvalue()
