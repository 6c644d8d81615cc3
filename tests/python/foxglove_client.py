#!/usr/bin/env python3
"""A viewer that is none of hilare's: the Foxglove WebSocket protocol by its specification, over the websockets package.

    foxglove_client.py look URL          what there is to see of a robot that is up, once each topic of LOOKED_AT has come
    foxglove_client.py follow URL DIR    everything until the robot ends, held against the recording and report in DIR

Messages are decoded by mcap-ros2-support, by the schemas the server tells, and the standard ones by rosbags, which
knows their definitions itself. Prints JSON; what is wrong stops it with an error.
"""

import asyncio
import json
import math
import struct
import sys
import time
from pathlib import Path

from mcap.reader import make_reader
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_typestore
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

PATIENCE_S = 60
LOOKED_AT = {"/odom", "/tf", "/path", "/cmd_vel", "/diagnostics", "/cross_track_error", "/reference", "/hilare/pose", "/map", "/footprint"}
STANDARD = get_typestore(Stores.ROS2_JAZZY)


async def joined(url):
    """The connection, as soon as there is one, and what the server says of itself."""
    deadline = time.monotonic() + PATIENCE_S
    while True:
        try:
            socket = await connect(url, subprotocols=["foxglove.sdk.v1"], max_size=None, proxy=None)
            break
        except OSError:
            assert time.monotonic() < deadline, f"nobody listens at {url}"
            await asyncio.sleep(0.02)
    assert socket.subprotocol == "foxglove.sdk.v1"
    info, told = json.loads(await socket.recv()), json.loads(await socket.recv())
    assert (info["op"], told["op"]) == ("serverInfo", "advertise"), (info, told)
    assert info["capabilities"] == [] and "supportedEncodings" not in info, info
    return socket, info, {channel["id"]: channel for channel in told["channels"]}


async def messages(socket, channels):
    """Every message of every channel: channel, time, bytes."""
    # Numbers of our own, so that they cannot be taken for the server's.
    subscriptions = [{"id": 1000 + channel, "channelId": channel} for channel in channels]
    await socket.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))
    async for message in socket:
        assert isinstance(message, bytes), message
        opcode, subscription, time_ns = struct.unpack("<BIQ", message[:13])
        assert opcode == 1
        yield channels[subscription - 1000], time_ns, message[13:]


def decoder(channel):
    assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg"), channel
    schema = Schema(id=1, name=channel["schemaName"], encoding="ros2msg", data=channel["schema"].encode())
    return DecoderFactory().decoder_for("cdr", schema)


def heading(q):
    return 2 * math.atan2(q.z, q.w)


async def look(url):
    socket, info, channels = await joined(url)
    seen = {}
    async with asyncio.timeout(PATIENCE_S):
        async for channel, _, data in messages(socket, channels):
            seen[channel["topic"]] = (channel, data)
            if LOOKED_AT <= seen.keys():
                break
    await socket.close()
    decoded = {topic: decoder(channel)(data) for topic, (channel, data) in seen.items()}
    # The same by definitions that did not come from the server.
    for topic, (channel, data) in seen.items():
        if channel["schemaName"] in STANDARD.types:
            STANDARD.deserialize_cdr(data, channel["schemaName"])
    odom = STANDARD.deserialize_cdr(seen["/odom"][1], "nav_msgs/msg/Odometry")
    path = STANDARD.deserialize_cdr(seen["/path"][1], "nav_msgs/msg/Path")
    at, twist = odom.pose.pose, odom.twist.twist
    assert (at.position.x, at.position.y) == (decoded["/odom"].pose.pose.position.x, decoded["/odom"].pose.pose.position.y)
    grid = STANDARD.deserialize_cdr(seen["/map"][1], "nav_msgs/msg/OccupancyGrid")
    footprint = STANDARD.deserialize_cdr(seen["/footprint"][1], "geometry_msgs/msg/PolygonStamped")
    width, cell_m, corner = grid.info.width, grid.info.resolution, grid.info.origin.position
    occupied = [index for index, value in enumerate(grid.data) if value == 100]
    assert len(grid.data) == width * grid.info.height and grid.header.frame_id == "map"
    return {
        "map_m": [corner.x, corner.y, width * cell_m, grid.info.height * cell_m],
        "occupied_m2": len(occupied) * cell_m**2,
        "occupied_from_m": corner.y + occupied[0] // width * cell_m,
        "footprint_frame": footprint.header.frame_id,
        "footprint_m": round(max(math.hypot(p.x, p.y) for p in footprint.polygon.points), 6),
        "name": info["name"],
        "session": info["sessionId"],
        "topics": sorted(channel["topic"] for channel in channels.values()),
        "odom": [at.position.x, at.position.y, heading(at.orientation)],
        "twist": [twist.linear.x, twist.linear.y, twist.angular.z],
        "odom_frames": [odom.header.frame_id, odom.child_frame_id],
        "frames": [[t.header.frame_id, t.child_frame_id] for t in decoded["/tf"].transforms],
        "path_frame": path.header.frame_id,
        "path": [[pose.pose.position.x, pose.pose.position.y] for pose in path.poses],
        "reference_frame": decoded["/reference"].header.frame_id,
        "cross_track_error": decoded["/cross_track_error"].data,
        "diagnosed": decoded["/diagnostics"].status[0].name,
    }


def recorded(file):
    """Channels of a recording, and its messages by topic and tick."""
    channels, by_tick, decoders = {}, {}, {}
    with open(file, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            decode = decoders.setdefault(channel.topic, DecoderFactory().decoder_for("cdr", schema))
            tick = getattr(decode(message.data), "tick", None)
            if tick is not None:
                by_tick[channel.topic, tick] = message.data
        summary = reader.get_summary()
        for channel in summary.channels.values():
            schema = summary.schemas[channel.schema_id]
            told = (channel.message_encoding, schema.name, schema.encoding, schema.data.decode())
            channels[channel.topic] = told
    return channels, by_tick


async def follow(url, directory):
    socket, _, channels = await joined(url)
    heard, ended = {}, False
    try:
        async for channel, time_ns, data in messages(socket, channels):
            heard.setdefault(channel["topic"], []).append((time_ns, data))
    except ConnectionClosed:
        ended = True
    deadline = time.monotonic() + PATIENCE_S
    while not (directory / "summary.json").exists():
        assert time.monotonic() < deadline, "there is no report"
        await asyncio.sleep(0.05)

    # One table: the same topics, types, definitions and encodings, live and recorded.
    known, by_tick = recorded(directory / "run.mcap")
    told = {
        c["topic"]: (c["encoding"], c["schemaName"], c["schemaEncoding"], c["schema"]) for c in channels.values()
    }
    assert told == known, set(told) ^ set(known)

    decoders = {channel["topic"]: decoder(channel) for channel in channels.values()}
    messages_of = {t: [(ns, decoders[t](data)) for ns, data in heard[t]] for t in heard if t in decoders}
    # What is seen is what is recorded, bit for bit, and a millisecond a tick.
    compared, epochs = {}, set()
    for topic in ("/hilare/pose", "/hilare/steps", "/hilare/truth", "/hilare/reference"):
        # The recorder may go before the robot's last ticks.
        newest = max(tick for of, tick in by_tick if of == topic)
        for (time_ns, message), (_, data) in zip(messages_of[topic], heard[topic]):
            epochs.add(time_ns - message.tick * 1_000_000)
            if message.tick <= newest:
                assert by_tick[topic, message.tick] == data, (topic, message.tick)
                compared[topic] = compared.get(topic, 0) + 1
    (epoch,) = epochs
    # Odometry and transforms are of the pose and the twist of their tick.
    poses = {tick: decoders["/hilare/pose"](data) for (topic, tick), data in by_tick.items() if topic == "/hilare/pose"}
    steps = {tick: decoders["/hilare/steps"](data) for (topic, tick), data in by_tick.items() if topic == "/hilare/steps"}
    ticks = []
    for time_ns, odom in messages_of["/odom"]:
        tick = (time_ns - epoch) // 1_000_000
        if tick not in poses or tick not in steps:
            continue
        stamp = odom.header.stamp.sec * 1_000_000_000 + odom.header.stamp.nanosec
        at, twist = odom.pose.pose, odom.twist.twist
        assert stamp == time_ns and (at.position.x, at.position.y) == (poses[tick].x_m, poses[tick].y_m), tick
        assert abs(math.remainder(heading(at.orientation) - poses[tick].theta_rad, 2 * math.pi)) < 1e-9, tick
        assert [twist.linear.x, twist.linear.y, twist.angular.z] == list(steps[tick].twist), tick
        ticks.append(tick)
    for time_ns, tf in messages_of["/tf"]:
        pose = poses.get((time_ns - epoch) // 1_000_000)
        if pose is None:
            continue
        _, moving = tf.transforms
        assert (moving.transform.translation.x, moving.transform.translation.y) == (pose.x_m, pose.y_m)
    last = messages_of["/odom"][-1][1].pose.pose
    return {
        "ended": ended,
        "compared": compared,
        "least_ticks_between": min(b - a for a, b in zip(ticks, ticks[1:])),
        "last": [last.position.x, last.position.y, heading(last.orientation)],
        "last_tick": ticks[-1],
        "cross_track_error_max_m": max(abs(m.data) for _, m in messages_of["/cross_track_error/truth"]),
    }


def main():
    how, url = sys.argv[1:3]
    if how == "look":
        out = asyncio.run(look(url))
    else:
        out = asyncio.run(follow(url, Path(sys.argv[3])))
    print(json.dumps(out))


main()
