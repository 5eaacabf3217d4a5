"""Why a picture is not made."""

from __future__ import annotations

from rebt_ros.errors import RebtError


class PictureError(RebtError):
    """A picture cannot be made; everything else can."""


class MatplotlibMissingError(PictureError):
    """matplotlib is not installed, or does not work with what is."""


class PictureTooLargeError(PictureError):
    """A PNG file of the picture would be huge or could not be read."""
