"""LCM's UDP multicast in a few lines, for Python without LCM's own module (Debian 12 has none).

Sends messages below 64 kB, which LCM puts into one datagram: "LC02", a sequence number, the channel's name with a final
zero byte, the encoded message. With LCM's module installed, `lcm.LCM(url).publish(channel, data)` does the same.
"""

import os
import socket
import struct
from urllib.parse import parse_qs, urlparse


class Publisher:
    def __init__(self, url=None):
        """url: as LCM_DEFAULT_URL, such as udpm://239.255.76.67:7667?ttl=0, which is also the default."""
        parsed = urlparse(url or os.environ.get("LCM_DEFAULT_URL") or "udpm://239.255.76.67:7667?ttl=0")
        if parsed.scheme != "udpm":
            raise ValueError(f"{parsed.scheme} is not a UDP multicast provider")
        self.address = (parsed.hostname or "239.255.76.67", parsed.port or 7667)
        self.sequence = 0
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        ttl = int(parse_qs(parsed.query).get("ttl", ["0"])[0])
        self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, ttl)

    def publish(self, channel, data):
        self.socket.sendto(b"LC02" + struct.pack(">I", self.sequence) + channel.encode() + b"\0" + data, self.address)
        self.sequence += 1
