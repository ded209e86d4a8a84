#include "server/webhook_metrics.h"

#include <string>
#include <utility>
#include <vector>

namespace joulecast::server {

void export_webhook_metrics(Metrics& metrics, const Webhooks& webhooks) {
  metrics.series([&webhooks] {
    std::vector<Metrics::Series> all{
        {"joulecast_webhook_delivered_total", "Events delivered"},
        {"joulecast_webhook_failed_total", "Attempts to deliver an event that failed"},
        {"joulecast_webhook_dropped_total", "Events dropped since too many waited (webhooks.queue)"},
        {"joulecast_webhook_given_up_total", "Events dropped after their last attempt"},
        {"joulecast_webhook_waiting", "Events that wait for a webhook"}};
    std::size_t number = 0;  // two of them may have one host
    for (const auto& [host, counts] : webhooks.status()) {
      const Labels labels{{"webhook", std::to_string(number++)}, {"host", host}};
      const double values[] = {static_cast<double>(counts.delivered), static_cast<double>(counts.failed),
                               static_cast<double>(counts.dropped), static_cast<double>(counts.given_up),
                               static_cast<double>(counts.waiting)};
      for (std::size_t k = 0; k < all.size(); ++k) all[k].rows.emplace_back(labels, values[k]);
    }
    return all;
  });
}

}  // namespace joulecast::server
