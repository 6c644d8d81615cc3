"""How the messages lie in memory according to ctypes: layouts.py DIRECTORY_OF_HILARE_WIRES.

A line for each message (name, size, layout hash worked out anew), each field (offset, size, type, elements), each
wire (service, layout).
"""

import ctypes
import sys

sys.path.insert(0, sys.argv[1])
import hilare_wires as wires

SCALARS = {ctypes.c_double: "f64", ctypes.c_int64: "i64", ctypes.c_uint64: "u64", ctypes.c_char: "u8"}


def element(kind):
    """Type and number of the elements of a field."""
    count = 1
    while isinstance(kind, type(ctypes.c_double * 1)):
        count, kind = count * kind._length_, kind._type_
    return kind, count


def name_of(kind):
    """What the type is called on the wire."""
    return SCALARS[kind] if kind in SCALARS else kind.type_name()


def fnv1a(data, state):
    """FNV-1a, with a separator after each piece."""
    for byte in data + b"\xff":
        state = ((state ^ byte) * 0x100000001B3) % 2**64
    return state


def layout_hash(message):
    """Of the name, and of each field's name, type, length and offset."""
    state = fnv1a(message.type_name().encode(), 0xCBF29CE484222325)
    for name, kind in message._fields_:
        kind, count = element(kind)
        offset = getattr(message, name).offset
        for piece in (name.encode(), name_of(kind).encode(), count.to_bytes(8, "little"), offset.to_bytes(8, "little")):
            state = fnv1a(piece, state)
    return state


def main():
    """Every message and wire of the module."""
    everything = [value for _, value in sorted(vars(wires).items())]
    messages = [one for one in everything if isinstance(one, type) and issubclass(one, ctypes.Structure)]
    for message in messages:
        print(f"{message.__name__} {message.type_name()} {ctypes.sizeof(message)} {layout_hash(message):016x}")
        for name, kind in message._fields_:
            field, (inner, count) = getattr(message, name), element(kind)
            print(f"{message.__name__}.{name} {field.offset} {field.size} {name_of(inner)} {count}")
    for wire in everything:
        if isinstance(wire, wires.Wire):
            print(f"{wire.service} {wire.layout}")


if __name__ == "__main__":
    main()
