"""Fills a ROS message from a dictionary of its fields; knows no message by name."""


def fill(message, fields, types):
    """The message with these fields. `types` says of which type the items of a list are."""
    for name, value in fields.items():
        if isinstance(value, dict):
            fill(getattr(message, name), value, types)
        elif isinstance(value, list) and name in types:
            setattr(message, name, [fill(types[name](), item, types) for item in value])
        else:
            setattr(message, name, value)
    return message
