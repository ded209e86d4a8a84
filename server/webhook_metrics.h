#pragma once

#include "server/metrics.h"
#include "server/webhooks/webhooks.h"

namespace joulecast::server {

// joulecast_webhook_*: of each webhook, by its number in the file and its host. Both must outlive the
// metrics.
void export_webhook_metrics(Metrics& metrics, const Webhooks& webhooks);

}  // namespace joulecast::server
