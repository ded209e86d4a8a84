#pragma once

#include "server/metrics.h"
#include "server/mqtt/battery_topics.h"

namespace joulecast::server {

// joulecast_mqtt_*. Both must outlive the metrics.
void export_mqtt_metrics(Metrics& metrics, const BatteryTopics& topics);

}  // namespace joulecast::server
