"""The PTP responder: one operation in, a response out; what carries them is the front end's business.

Codes and datasets: PIMA 15740:2000 as restated in the project's reference. Missing parameters count as 0, as real
clients leave trailing zeros out.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from simulators.camera import datasets
from simulators.camera.body import Camera
from simulators.camera.store import EXIF_JPEG, STORAGE, StoredObject

OK, SESSION_NOT_OPEN, BAD_TRANSACTION, OPERATION_NOT_SUPPORTED = 0x2001, 0x2003, 0x2004, 0x2005
BAD_STORAGE, BAD_HANDLE, PROPERTY_NOT_SUPPORTED, BAD_FORMAT, STORE_FULL = 0x2008, 0x2009, 0x200A, 0x200B, 0x200C
ACCESS_DENIED, NO_THUMBNAIL, DEVICE_BUSY = 0x200F, 0x2010, 0x2019
BAD_PROPERTY_FORMAT, BAD_PROPERTY_VALUE, BAD_PARAMETER, SESSION_ALREADY_OPEN = 0x201B, 0x201C, 0x201D, 0x201E

GET_DEVICE_INFO, OPEN_SESSION, CLOSE_SESSION, INITIATE_CAPTURE, SET_VALUE = 0x1001, 0x1002, 0x1003, 0x100E, 0x1016
GET_OBJECT, GET_THUMB, GET_PARTIAL = 0x1009, 0x100A, 0x101B
EVERYTHING: Final = 0xFFFF_FFFF

TAKES_DATA: Final = frozenset({SET_VALUE})
"""Operations whose data come from the client."""


@dataclass(frozen=True, slots=True)
class Response:
    """The answer to an operation.

    Attributes
    ----------
    code
        Response code.
    parameters
        Response parameters.
    data
        Data for the client; ``None`` without a data phase.
    """

    code: int = OK
    parameters: tuple[int, ...] = ()
    data: bytes | None = None


class Responder:
    """One client's session with a camera.

    Parameters
    ----------
    camera
        The camera.
    needs_complete
        Whether CaptureComplete is sent even where the model does not (PTP/IP clients wait for it for ever).
    serial
        Serial number in DeviceInfo.
    """

    def __init__(self, camera: Camera, *, needs_complete: bool = False, serial: str = "000003004711") -> None:
        self.camera = camera
        self.session = 0
        self._tells_complete = needs_complete or camera.profile.capture_complete
        self._serial = serial
        self._operations: dict[int, Callable[[Sequence[int], bytes], Response]] = {
            0x1004: lambda p, d: Response(data=datasets.handles([STORAGE])),
            0x1005: self._storage_info,
            0x1006: self._number_of_objects,
            0x1007: self._object_handles,
            0x1008: self._object_info,
            GET_OBJECT: self._object,
            GET_THUMB: self._thumbnail,
            0x100B: self._delete,
            0x1014: self._describe,
            0x1015: self._value,
            SET_VALUE: self._set_value,
            GET_PARTIAL: self._partial,
        }

    def execute(self, operation: int, transaction: int, parameters: Sequence[int], data: bytes = b"") -> Response:
        """Do one operation."""
        refusals = self.camera.faults.refuse.get(operation)
        if refusals:
            return Response(refusals.pop(0))
        profile = self.camera.profile
        if operation not in profile.operations and operation not in profile.unlisted_operations:
            return Response(OPERATION_NOT_SUPPORTED)
        padded = (*parameters, *[0] * (5 - len(parameters)))
        if operation == GET_DEVICE_INFO:
            return Response(data=datasets.device_info(profile, self._serial))
        if operation == OPEN_SESSION:
            return self._open(padded[0])
        if not self.session:
            return Response(SESSION_NOT_OPEN)
        if operation == CLOSE_SESSION:
            self.session = 0
            return Response()
        if operation == INITIATE_CAPTURE:
            return self._capture(padded, transaction)
        return self._operations[operation](padded, data)

    def _open(self, session: int) -> Response:
        if self.session:
            return Response(SESSION_ALREADY_OPEN, (self.session,))
        if not session:
            return Response(BAD_PARAMETER)
        self.session = session
        self.camera.events.clear()
        return Response()

    # --- storage and objects ---

    def _storage_info(self, p: Sequence[int], data: bytes) -> Response:
        return Response(data=datasets.storage_info(self.camera.card)) if p[0] == STORAGE else Response(BAD_STORAGE)

    def _select(self, p: Sequence[int]) -> list[int] | Response:
        if p[0] not in (STORAGE, EVERYTHING):
            return Response(BAD_STORAGE)
        if p[2] not in (0, EVERYTHING) and p[2] not in self.camera.card.objects:
            return Response(BAD_HANDLE)
        return self.camera.card.select(p[1], p[2])

    def _number_of_objects(self, p: Sequence[int], data: bytes) -> Response:
        found = self._select(p)
        return found if isinstance(found, Response) else Response(parameters=(len(found),))

    def _object_handles(self, p: Sequence[int], data: bytes) -> Response:
        found = self._select(p)
        return found if isinstance(found, Response) else Response(data=datasets.handles(found))

    def _object_info(self, p: Sequence[int], data: bytes) -> Response:
        item = self.camera.card.objects.get(p[0])
        return Response(data=datasets.object_info(item)) if item else Response(BAD_HANDLE)

    def _file(self, handle: int) -> StoredObject | None:
        item = self.camera.card.objects.get(handle)
        return item if item and item.file else None

    def _object(self, p: Sequence[int], data: bytes) -> Response:
        item = self._file(p[0])
        return Response(data=item.file.data) if item and item.file else Response(BAD_HANDLE)

    def _partial(self, p: Sequence[int], data: bytes) -> Response:
        item = self._file(p[0])
        if not item or not item.file:
            return Response(BAD_HANDLE)
        part = item.file.data[p[1] : p[1] + p[2]]
        return Response(parameters=(len(part),), data=part)

    def _thumbnail(self, p: Sequence[int], data: bytes) -> Response:
        item = self.camera.card.objects.get(p[0])
        if item is None:
            return Response(BAD_HANDLE)
        return Response(data=item.file.thumbnail) if item.file else Response(NO_THUMBNAIL)

    def _delete(self, p: Sequence[int], data: bytes) -> Response:
        objects = self.camera.card.objects
        if p[0] == EVERYTHING:
            for handle in [h for h, item in objects.items() if item.file and p[1] in (0, item.format)]:
                del objects[handle]
            return Response()
        if not self._file(p[0]):
            return Response(BAD_HANDLE if p[0] not in objects else ACCESS_DENIED)
        del objects[p[0]]
        return Response()

    # --- properties ---

    def _describe(self, p: Sequence[int], data: bytes) -> Response:
        item = self.camera.setting(p[0])
        if item is None:
            return Response(PROPERTY_NOT_SUPPORTED)
        return Response(data=datasets.property_description(item, self.camera.value(p[0])))

    def _value(self, p: Sequence[int], data: bytes) -> Response:
        item = self.camera.setting(p[0])
        if item is None:
            return Response(PROPERTY_NOT_SUPPORTED)
        return Response(data=datasets.value(item.type, self.camera.value(p[0])))

    def _set_value(self, p: Sequence[int], data: bytes) -> Response:
        item = self.camera.setting(p[0])
        if item is None:
            return Response(PROPERTY_NOT_SUPPORTED)
        if not item.writable:
            return Response(ACCESS_DENIED)
        if self.camera.busy:
            return Response(DEVICE_BUSY)
        try:
            wanted = datasets.parse_value(item.type, data)
        except ValueError:
            return Response(BAD_PROPERTY_FORMAT)
        if item.choices and wanted not in item.choices:
            return Response(BAD_PROPERTY_VALUE)
        try:
            self.camera.set_value(item.code, wanted)
        except ValueError:
            return Response(BAD_PROPERTY_VALUE)
        return Response()

    # --- capture ---

    def _capture(self, p: Sequence[int], transaction: int) -> Response:
        """Answer at once; the exposure follows."""
        if p[0] not in (0, STORAGE):
            return Response(BAD_STORAGE)
        if p[1] not in (0, EXIF_JPEG):
            return Response(BAD_FORMAT)
        if self.camera.busy:
            return Response(DEVICE_BUSY)
        if self.camera.full:
            return Response(STORE_FULL)
        self.camera.capture(transaction, tell_complete=self._tells_complete)
        return Response()
