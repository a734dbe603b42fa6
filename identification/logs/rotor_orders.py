"""Vehicles' orders of motors, by name.

An order gives the motor of each of the kit's rotors: 1 front-left, 2 rear-left, 3 rear-right, 4
front-right. ``column_words.yaml`` states them and their sources.
"""

from ...runtime.errors import InputError, unknown_name
from .column_names import WORDS

Order = tuple[int, int, int, int]

PLACES = ("front-left", "rear-left", "rear-right", "front-right")  # of rotors 1 to 4

ORDERS: dict[str, Order] = {
    name: (a, b, c, d) for name, (a, b, c, d) in WORDS["rotor_orders"].items()
}


def rotor_order(value: object) -> Order:
    """Return the motor, from 1, of each of the kit's rotors.

    Args:
        value: a name of ``ORDERS``, or the four motors' numbers, front-left first.

    Raises:
        InputError: neither.
    """
    if isinstance(value, str):
        if value not in ORDERS:
            raise unknown_name("rotor order", value, ORDERS)
        return ORDERS[value]
    if isinstance(value, list | tuple) and sorted(map(str, value)) == ["1", "2", "3", "4"]:
        a, b, c, d = (int(str(x)) for x in value)
        return a, b, c, d
    raise InputError(
        f"{value!r}; expected one of {', '.join(ORDERS)}, or the numbers of the motors "
        f"at the {', '.join(PLACES)}, such as [3, 2, 4, 1]"
    )


def order_words(order: Order) -> str:
    """Return an order in words."""
    places = sorted(zip(order, PLACES, strict=True))
    return f"motors {', '.join(f'{motor} {place}' for motor, place in places)}"


def order_names(order: tuple[int, ...]) -> list[str]:
    """Return the names of an order, if any."""
    return [name for name, known in ORDERS.items() if known == order]
