"""The report as a page."""

from rebt_ros.experiment.report import Report


def report_page(report: Report) -> str:
    """The page."""
    return ""
