#include "server/mqtt_metrics.h"

namespace joulecast::server {

void export_mqtt_metrics(Metrics& metrics, const BatteryTopics& topics) {
  const Gauge connected = metrics.gauge("joulecast_mqtt_connected", "Whether the MQTT broker is connected");
  const Counter connections =
      metrics.counter("joulecast_mqtt_connections_total", "Connections made to the MQTT broker");
  const Counter published =
      metrics.counter("joulecast_mqtt_published_total", "Battery messages handed to the MQTT broker");
  const Counter failed = metrics.counter("joulecast_mqtt_failed_total",
                                         "Messages that were not: the connection broke meanwhile");
  metrics.before_scrape([=, &topics] {
    const BatteryTopics::Status now = topics.status();
    connected.set(now.connected ? 1 : 0);
    connections.raise_to(static_cast<double>(now.connections));
    published.raise_to(static_cast<double>(now.published));
    failed.raise_to(static_cast<double>(now.failed));
  });
}

}  // namespace joulecast::server
