"""The table's outline as three convex parts, and the position of its image on the pixel grid.

The table is drawn as an image of 191 x 59 px. Its solid part is a circle at the human's end, a board with rounded
corners and a triangle at the robot's end, with gaps of 4 px between them: a rectangle would collide where the
original does not. Image coordinates (u, v) have their origin in the middle of the image, u to the right and v down
at theta = 0; theta turns counter-clockwise on screen.
"""

import math

IMAGE_SIZE = (191, 59)
"""Width and height of the table's image at theta = 0, px; contact with walls includes its transparent corners."""

CIRCLE_CENTRE = (-78.0, 0.0)
CIRCLE_RADIUS = 17.5
BOARD = (-56.5, -29.5, 51.5, 29.5)
"""Left, top, right, bottom in image coordinates, px; the board's middle is 2.5 px off the image's."""
BOARD_CORNER_RADIUS = 13.0
TRIANGLE = ((55.5, 17.5), (72.5, -16.5), (76.5, -16.5), (95.5, 17.5))

REACH = math.hypot(95.5, 17.5)
"""Distance of the outermost solid point from the centre, px."""

CIRCLE_FRINGE = 0.3
"""Distance by which the corners of pixels extend beyond the circle that they draw, px."""

PART_BOUNDS = (
    (*CIRCLE_CENTRE, CIRCLE_RADIUS + CIRCLE_FRINGE),
    (-2.5, 0.0, math.hypot(54.0, 29.5)),
    (75.5, 2.0, math.hypot(20.5, 18.5)),
)
"""A circle (u, v, radius) around each part, in the order of `solids.table_shapes`, px."""


def image_size(cos: float, sin: float) -> tuple[int, int]:
    """Width and height of the box of the rotated image, px, which must stay in the window."""
    width, height = IMAGE_SIZE
    cos, sin = abs(cos), abs(sin)
    return int(width * cos + height * sin), int(width * sin + height * cos)


def drawn_centre(x: float, y: float, image_width: int) -> tuple[float, float]:
    """Centre of the drawn image on screen, px: the position truncated to whole pixels, plus half a pixel that
    depends on the width of the rotated image (pygame's rotation, verified on 6,000 rotated masks)."""
    return int(x) + 0.5 * (image_width & 1), int(y) + 0.5
