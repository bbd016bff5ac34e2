"""A program whose state is how often it was asked: it turns at every so many calls."""

import json
import os
import signal
import struct
import sys

import pyarrow as pa


def frame(table, batch, **about):
    sink = pa.BufferOutputStream()
    schema = batch.schema.with_metadata({"table": table, **about})
    with pa.ipc.new_stream(sink, schema) as writer:
        writer.write_table(pa.Table.from_batches([batch]).cast(schema))
    content = sink.getvalue().to_pybytes()
    return struct.pack("<Q", len(content)) + content


asked, every, snapshots, dies_at = 0, 0, False, None
while True:
    answer = b""
    while length := struct.unpack("<Q", sys.stdin.buffer.read(8) or sys.exit())[0]:
        table = pa.ipc.open_stream(sys.stdin.buffer.read(length)).read_all()
        name = table.schema.metadata[b"table"]
        if name == b"hello":
            snapshots = table.schema.metadata[b"snapshots"] == b"true"
            told = json.loads(table.schema.metadata[b"arguments"])
            every, dies_at, marker = told["every"], told.get("dies_at"), told.get("marker", "")
            empty = pa.RecordBatch.from_pydict({})
            answer += frame("hello", empty, version="1", snapshots="true")
        if name == b"state":
            asked = int(table.column("state")[0].as_py())
        if name == b"call":
            asked += 1
            if asked == dies_at and not os.path.exists(marker):
                open(marker, "w").close()
                os.kill(os.getpid(), signal.SIGKILL)
            if asked % every == 0:
                turn = {"turn_rad": [0.01 * asked], "rate_rad_s": [0.05]}
                answer += frame("manoeuvres", pa.RecordBatch.from_pydict(turn))
    if snapshots:
        answer += frame("state", pa.RecordBatch.from_pydict({"state": [str(asked).encode()]}))
    sys.stdout.buffer.write(answer + struct.pack("<Q", 0))
    sys.stdout.buffer.flush()
