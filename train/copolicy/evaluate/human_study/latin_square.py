"""Orders of conditions in which each comes at each place, and after each other one, equally often."""


def williams_square(count: int) -> list[list[int]]:
    """Williams' design (1949): rows are orders of `count` conditions, one for each participant in turn.

    With an even number, one square of `count` rows; with an odd one, that square and its mirror image.
    """
    first = [0]
    low, high = 1, count - 1
    while len(first) < count:
        first.append(low if len(first) % 2 else high)
        low, high = (low + 1, high) if len(first) % 2 == 0 else (low, high - 1)
    square = [[(condition + row) % count for condition in first] for row in range(count)]
    return square if count % 2 == 0 or count == 1 else square + [row[::-1] for row in square]
