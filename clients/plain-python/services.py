"""Joins every service that wire.json describes, and says for a second's listening what came from each: services.py [SECONDS]."""

import sys
import time

from wire import Wire

wire = Wire()
ports, counts = {}, {}
for name, service in wire.services.items():
    joined = wire.service(name)
    if service["pattern"] == "publish_subscribe":
        ports[name] = joined.subscriber_builder().create()
        counts[name] = 0
        if service["max_publishers"] > 1:
            joined.publisher_builder().create()
    elif service["pattern"] == "request_response":
        joined.client_builder().create()
        print(f"{name}: a client's place")
    else:
        listener = joined.listener_builder().create()
        joined.notifier_builder().create().notify()
        print(f"{name}: heard {listener.try_wait()} of its own")

end = time.monotonic() + float(sys.argv[1] if len(sys.argv) > 1 else 1.0)
while time.monotonic() < end:
    for name, port in ports.items():
        while (sample := port.receive()) is not None:
            counts[name] += 1
            sample.delete()
    time.sleep(0.005)
for name, count in counts.items():
    print(f"{name}: {count} samples")
