#include "server/mqtt_metrics.h"

namespace joulecast::server {

void export_mqtt_metrics(Metrics& metrics, const BatteryTopics& topics) {
  using S = BatteryTopics::Status;
  metrics.rows<S>(
      [&topics] { return topics.status(); },
      {{"joulecast_mqtt_connected", "Whether the MQTT broker is connected", &S::connected},
       {"joulecast_mqtt_connections_total", "Connections made to the MQTT broker", &S::connections},
       {"joulecast_mqtt_published_total", "Battery messages handed to the MQTT broker", &S::published},
       {"joulecast_mqtt_failed_total", "Messages that were not, since the connection was lost", &S::failed}});
}

}  // namespace joulecast::server
