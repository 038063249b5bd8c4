"""Fills any ROS message from a dictionary of its fields."""


def fill(message, fields, types):
    """Fills a message and returns it. `types` gives the item type of each list field."""
    for name, value in fields.items():
        if isinstance(value, dict):
            fill(getattr(message, name), value, types)
        elif isinstance(value, list) and name in types:
            setattr(message, name, [fill(types[name](), item, types) for item in value])
        else:
            setattr(message, name, value)
    return message
