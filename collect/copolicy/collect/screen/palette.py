"""The colours of the screen: the palette of Okabe and Ito, safe for the common forms of colour blindness.

Nothing is shown by colour alone: the seats also differ in shape (triangle, circle), goal and obstacles in pattern.
"""

Colour = tuple[int, int, int]

BLUE: Colour = (0, 114, 178)
ORANGE: Colour = (230, 159, 0)
GREEN: Colour = (0, 158, 115)
VERMILION: Colour = (213, 94, 0)
SKY: Colour = (86, 180, 233)
YELLOW: Colour = (240, 228, 66)

SEATS: tuple[Colour, Colour] = (BLUE, ORANGE)
"""Robot seat (blue triangle), human seat (orange circle)."""

FLOOR: Colour = (247, 246, 241)
FLOOR_DOT: Colour = (222, 220, 212)
SURROUND: Colour = (24, 28, 36)
PANEL: Colour = (35, 41, 53)
PANEL_EDGE: Colour = (62, 71, 89)
SHADOW: Colour = (216, 213, 204)
WOOD: Colour = (178, 132, 88)
WOOD_EDGE: Colour = (116, 80, 47)
OBSTACLE: Colour = (58, 62, 72)
OBSTACLE_STRIPE: Colour = (96, 101, 113)
INK: Colour = (28, 32, 40)
TEXT: Colour = (240, 242, 246)
MUTED: Colour = (160, 170, 187)


def mix(first: Colour, second: Colour, proportion: float) -> Colour:
    """Returns a mixture of two colours, with a proportion in [0, 1] of the second."""
    red, green, blue = (round(a + proportion * (b - a)) for a, b in zip(first, second, strict=True))
    return red, green, blue
