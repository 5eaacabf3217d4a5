"""A robot that is demonstrated at a fixed rate, as a process: states that count, and actions.

    python load_publisher.py STATE_RATE ACTION_RATE WIDTH SECONDS SUBSCRIBERS

State n is [n, 0.5, 0.5, ...].  Every (STATE_RATE / ACTION_RATE)th state is followed by an action.
It begins once the states have so many subscribers and the actions have one, and ends after so many
seconds, or never after 0; then it prints how many states and actions it sent.
"""

from __future__ import annotations

import json
import sys
import time

import rclpy
from rclpy.duration import Duration
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64MultiArray, String

ACTIONS = ("go", "turn left", "turn right", "stop")


def main() -> None:
    state_rate, action_rate, width, seconds, subscribers = map(float, sys.argv[1:])
    every = round(state_rate / action_rate)
    rclpy.init()
    node = rclpy.create_node("load_publisher")
    states = node.create_publisher(Float64MultiArray, "state", QoSProfile(depth=5000))
    actions = node.create_publisher(String, "action", QoSProfile(depth=5000))
    while states.get_subscription_count() < subscribers or not actions.get_subscription_count():
        time.sleep(0.02)
    message = Float64MultiArray(data=[0.5] * round(width))
    sent = [0, 0]
    start = time.monotonic()
    while (elapsed := time.monotonic() - start) < (seconds or float("inf")):
        while sent[0] < elapsed * state_rate:
            message.data[0] = float(sent[0])
            states.publish(message)
            if sent[0] % every == 0:
                actions.publish(String(data=ACTIONS[sent[1] % len(ACTIONS)]))
                sent[1] += 1
            sent[0] += 1
            if sent[0] == 1:
                # A subscriber that is known here may not know of this publisher yet.
                for publisher in (states, actions):
                    publisher.wait_for_all_acked(Duration(seconds=10))
                start = time.monotonic()
        time.sleep(0.0005)
    for publisher in (states, actions):
        publisher.wait_for_all_acked(Duration(seconds=10))
    print(json.dumps({"states": sent[0], "actions": sent[1]}), flush=True)
    # Its last messages are repeated where a subscriber missed them, so it stays until it is killed.
    sys.stdin.read()


if __name__ == "__main__":
    main()
