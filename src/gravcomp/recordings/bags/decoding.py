"""Messages of a bag, decoded by the definitions that the bag carries, or by those of ROS 2 Jazzy where it carries none.

To read a definition and to make the functions of its type takes longer than to decode thousands of messages, and a bag of a robot
has dozens of types. So a type is read at its first message, once in a process for all bags that define it alike.
"""

from functools import lru_cache
from typing import Any

from rosbags.interfaces import Connection, MessageDefinition, MessageDefinitionFormat
from rosbags.interfaces.typing import Typesdict
from rosbags.rosbag2 import ReaderError
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

UNREADABLE = (ReaderError, SerdeError, TypesysError, OSError, KeyError)
"""Errors of opening a bag, of reading it and of decoding its messages."""

_KEPT = 256  # types: a process that reads bags of many robots and releases must not grow
_IDL_FILE = 80 * "=" + "\nIDL: "  # before each file of a definition in IDL


def decoded(connection: Connection, serialised: bytes) -> Any:
    """Return a message of a bag. Raises an error of UNREADABLE where the definition or the message is damaged or unknown."""
    return _store(connection.msgtype, connection.msgdef, connection.digest).deserialize_cdr(serialised, connection.msgtype)


@lru_cache(_KEPT)
def _store(name: str, definition: MessageDefinition, digest: str) -> Typestore:
    """Return the types that messages of the type `name` need.

    Raises TypesysError for a definition that cannot be read, and where `digest` is that of another one.
    """
    if definition.format == MessageDefinitionFormat.NONE:
        return get_typestore(Stores.ROS2_JAZZY)
    store = get_typestore(Stores.EMPTY)
    store.register(_types(name, definition))
    if digest and (found := store.hash_rihs01(name)) != digest:
        raise TypesysError(f"the definition of {name} has the hash {found} in place of {digest}")
    return store


def _types(name: str, definition: MessageDefinition) -> Typesdict:
    if definition.format == MessageDefinitionFormat.MSG:
        return get_types_from_msg(definition.data, name)
    types: Typesdict = {}
    for text in definition.data.removeprefix(_IDL_FILE).split(_IDL_FILE):
        # The first line of a file names it, where files are named.
        types.update(get_types_from_idl(text.partition("\n")[2] if definition.data.startswith(_IDL_FILE) else text))
    return types
