"""The report: one HTML page that shows a data set, with everything it needs inside."""

from .command import add_report_command

__all__ = ["add_report_command"]
