"""Arrays of npz files, for the tests of the program, without numpy."""
import ast
import struct
import zipfile


def array(file, name):
    """Shape and numbers of an array of an npz file."""
    b = zipfile.ZipFile(file).read(name + ".npy")
    n = struct.unpack("<H", b[8:10])[0]
    head = ast.literal_eval(b[10:10 + n].decode())
    kind = {"<f4": "f", "<f8": "d", "<i4": "i", "|u1": "B"}[head["descr"]]
    data = b[10 + n:]
    return head["shape"], struct.unpack("<%d%s" % (len(data) // struct.calcsize(kind), kind), data)
