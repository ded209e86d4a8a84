#include "server/daemon_metrics.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "server/api/robot_json.h"

namespace joulecast::server {

static_assert(history::MissionState{} == history::MissionState::open);

namespace {

template <class Totals>
void raise_to(const std::vector<Counter>& counters, const Totals& totals, std::size_t first = 0) {
  for (std::size_t k = 0; k < counters.size(); ++k)
    counters[k].raise_to(static_cast<double>(totals[first + k]));
}

template <class Names>
std::vector<Counter> counters_of(Metrics& metrics, const std::string& name, const std::string& help,
                                 const std::string& label, const Names& values) {
  return metrics.counters(name, help, label, {std::begin(values), std::end(values)});
}

void export_missions(Metrics& metrics, const ingest::IngestCounters& counters) {
  const auto started = metrics.counters("joulecast_missions_started_total", "Missions begun", "kind",
                                        {"announced", "implicit"});
  std::vector<std::string> states;  // but for the first one, open
  for (std::size_t k = 1; k < history::mission_state_count; ++k)
    states.emplace_back(history::name(static_cast<history::MissionState>(k)));
  const auto ended = metrics.counters("joulecast_missions_ended_total", "Missions ended", "state", states);
  const auto left_out =
      counters_of(metrics, "joulecast_missions_left_out_total", "Missions that were not used for training",
                  "reason", ingest::left_out_names);
  metrics.before_scrape([=, &counters] {
    raise_to(started, counters.missions_started);
    raise_to(ended, counters.missions_ended, 1);
    raise_to(left_out, counters.missions_left_out);
  });
}

void export_messages(Metrics& metrics, const ingest::IngestCounters& counters,
                     const ingest::IngestService& ingest) {
  const Counter messages =
      metrics.counter("joulecast_ingest_messages_total", "Messages received on the robots' channels");
  const Counter samples = metrics.counter("joulecast_ingest_samples_total", "Samples accounted for");
  const Counter covariates =
      metrics.counter("joulecast_ingest_covariate_changes_total", "Changes of covariates within missions");
  const auto faults =
      counters_of(metrics, "joulecast_ingest_faults_total",
                  "Messages, samples and events refused or repaired", "reason", ingest::ingest_fault_names);
  const auto contradictions =
      counters_of(metrics, "joulecast_contradictions_total",
                  "Reported contradictions of robots' telemetry, each at most once per hour", "kind",
                  ingest::contradiction_kind_names);
  const Counter datagrams =
      metrics.counter("joulecast_lcm_datagrams_total", "Datagrams received on the LCM group");
  const auto lost = counters_of(metrics, "joulecast_lcm_datagrams_dropped_total",
                                "Datagrams that gave no message; kernel: lost for want of receive buffer, "
                                "other_channel: LCM traffic of others",
                                "reason", telemetry::datagram_fault_names);
  const Gauge queue = metrics.gauge("joulecast_ingest_queue_messages", "Messages waiting to be accounted");
  const Gauge receiving = metrics.gauge("joulecast_ingest_receiving", "1 while LCM is being received");
  metrics.before_scrape([=, &counters, &ingest] {
    messages.raise_to(static_cast<double>(counters.messages));
    samples.raise_to(static_cast<double>(counters.samples));
    covariates.raise_to(static_cast<double>(counters.covariate_changes));
    raise_to(faults, counters.faults);
    raise_to(contradictions, counters.contradictions);
    datagrams.raise_to(static_cast<double>(counters.datagrams.received));
    raise_to(lost, counters.datagrams.faults);
    const ingest::IngestStatus status = ingest.status();
    queue.set(static_cast<double>(status.queue_messages));
    receiving.set(status.receiving ? 1 : 0);
  });
}

struct FleetStatus {
  std::size_t known = 0, live = 0, contradicted = 0;
  double power_w = 0;
};

FleetStatus status_of(const ingest::FleetView& fleet, std::int64_t now_utime_us) {
  const auto robots = fleet.all();
  FleetStatus status{.known = robots.size()};
  for (const auto& robot : robots) {
    if (!api::is_live(*robot, now_utime_us)) continue;
    ++status.live;
    status.contradicted += std::ranges::any_of(robot->contradictions, &ingest::Contradiction::untrue) ? 1 : 0;
    if (!std::isnan(robot->measured_power_w)) status.power_w += robot->measured_power_w;
  }
  return status;
}

void export_fleet(Metrics& metrics, const ingest::FleetView& fleet,
                  std::function<std::int64_t()> now_utime_us) {
  using S = FleetStatus;
  metrics.rows<S>(
      [&fleet, now = std::move(now_utime_us)] { return status_of(fleet, now()); },
      {{"joulecast_robots_known", "Robots received from since the daemon started", &S::known},
       {"joulecast_robots_live", "Robots received from within the last seconds", &S::live},
       {"joulecast_fleet_power_watts", "Measured battery power of all live robots", &S::power_w},
       {"joulecast_contradicted_robots",
        "Live robots with contradicted telemetry, which is not used for training", &S::contradicted}});
}

void export_writer(Metrics& metrics, const history::Writer& writer) {
  using S = history::WriterStatus;
  metrics.rows<S>(
      [&writer] { return writer.status(); },
      {{"joulecast_store_queue_commands", "Commands waiting to be committed", &S::queue_commands},
       {"joulecast_store_queue_bytes", "Memory that these commands hold", &S::queue_bytes},
       {"joulecast_store_queue_limit_bytes", "Memory that they may hold, store.queue_bytes",
        &S::queue_limit_bytes},
       {"joulecast_store_shed_samples_total", "Raw samples left out of the store because its queue was full",
        &S::shed_samples},
       {"joulecast_store_oldest_wait_seconds", "Age of the oldest command not yet committed",
        &S::oldest_wait_s},
       {"joulecast_store_healthy", "1 while commits succeed", &S::healthy},
       {"joulecast_store_commits_total", "Transactions committed", &S::commits},
       {"joulecast_store_failed_commits_total", "Commit attempts that failed and were tried again",
        &S::failed_commits},
       {"joulecast_store_refused_total", "Commands that the store refused", &S::refused},
       {"joulecast_store_commit_seconds_total", "Time spent in commits", &S::total_commit_s},
       {"joulecast_store_pruned_missions_total", "Missions dropped by the retention", &S::pruned_missions},
       {"joulecast_store_pruned_events_total", "Events dropped by the retention", &S::pruned_events},
       {"joulecast_store_pruned_audit_entries_total", "Entries of the audit dropped by the retention",
        &S::pruned_audit},
       {"joulecast_store_pruned_chunks_total", "Raw telemetry chunks that the retention dropped",
        &S::pruned_chunks}});
}

// joulecast_store_healthy reports a store whose sizes cannot be read.
void export_store(Metrics& metrics, StoreSizes& sizes) {
  using S = history::StoreSize;
  metrics.rows<S>([&sizes] { return sizes.read(); },
                  {{"joulecast_store_bytes", "Size of the database file", &S::database_bytes},
                   {"joulecast_store_journal_bytes", "Size of the write-ahead log", &S::journal_bytes},
                   {"joulecast_store_telemetry_bytes", "Encoded raw telemetry and covariates kept",
                    &S::telemetry_bytes}});
}

void export_streams(Metrics& metrics, const http::EventHub& events) {
  using S = http::EventHub::Counts;
  metrics.rows<S>([&events] { return events.counts(); },
                  {{"joulecast_event_streams", "Clients of the event stream", &S::subscribers},
                   {"joulecast_event_streams_dropped_total",
                    "Clients of the event stream dropped for being slow", &S::dropped_clients}});
}

}  // namespace

std::optional<history::StoreSize> StoreSizes::read() {
  constexpr std::chrono::milliseconds longest_wait{100};
  if (!reading_.valid()) reading_ = std::async(std::launch::async, [this] { return store_.size(); });
  if (reading_.wait_for(longest_wait) != std::future_status::ready) return std::nullopt;
  const Result<history::StoreSize> size = reading_.get();
  return size ? std::optional(*size) : std::nullopt;
}

void export_metrics(Metrics& metrics, const ingest::IngestCounters& counters,
                    const ingest::IngestService& ingest, const ingest::FleetView& fleet,
                    const history::Writer& writer, StoreSizes& sizes, const http::EventHub& events,
                    std::function<std::int64_t()> now_utime_us) {
  export_messages(metrics, counters, ingest);
  export_missions(metrics, counters);
  export_fleet(metrics, fleet, std::move(now_utime_us));
  export_writer(metrics, writer);
  export_store(metrics, sizes);
  export_streams(metrics, events);
}

void export_standby_metrics(Metrics& metrics, const history::Store& store) {
  using S = history::StandbyStatus;
  metrics.rows<S>(
      [&store] { return store.standby(); },
      {{"joulecast_store_standby_in_use", "1 while the standby of store.read_url answers", &S::in_use},
       {"joulecast_store_standby_staleness_seconds", "Replication delay of the standby; NaN: unknown",
        [](const S& s) { return s.staleness_s.value_or(std::nan("")); }},
       {"joulecast_store_standby_answers_total", "Queries answered by the standby", &S::answered},
       {"joulecast_store_standby_passed_on_total",
        "Queries answered by the server of store.url instead of the standby", &S::passed_on}});
}

}  // namespace joulecast::server
