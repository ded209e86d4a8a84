#include "server/daemon_metrics.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "server/api/robot_json.h"

namespace joulecast::server {

static_assert(history::MissionState{} == history::MissionState::open);

void export_metrics(Metrics& metrics, const ingest::IngestCounters& counters,
                    const ingest::IngestService& ingest, const ingest::FleetView& fleet,
                    const history::Writer& writer, const history::Store& store, const http::EventHub& events,
                    std::function<std::int64_t()> now_utime_us) {
  const Counter messages =
      metrics.counter("joulecast_ingest_messages_total", "Messages received on the robots' channels");
  const Counter samples = metrics.counter("joulecast_ingest_samples_total", "Samples accounted for");
  const Counter covariates =
      metrics.counter("joulecast_ingest_covariate_changes_total", "Changes of covariates within missions");
  const std::vector<Counter> started = metrics.counters("joulecast_missions_started_total", "Missions begun",
                                                        "kind", {"announced", "implicit"});
  std::vector<std::string> states;  // but for the first one, open
  for (std::size_t k = 1; k < history::mission_state_count; ++k)
    states.emplace_back(history::name(static_cast<history::MissionState>(k)));
  const std::vector<Counter> ended =
      metrics.counters("joulecast_missions_ended_total", "Missions ended", "state", states);
  const std::vector<Counter> faults = metrics.counters(
      "joulecast_ingest_faults_total", "Messages, samples and events turned away or repaired", "reason",
      std::vector<std::string>(ingest::ingest_fault_names.begin(), ingest::ingest_fault_names.end()));
  const std::vector<Counter> contradictions =
      metrics.counters("joulecast_contradictions_total",
                       "Contradictions of robots' telemetry told, each at most once an hour", "kind",
                       std::vector<std::string>(ingest::contradiction_kind_names.begin(),
                                                ingest::contradiction_kind_names.end()));
  const Gauge contradicted =
      metrics.gauge("joulecast_contradicted_robots",
                    "Live robots whose telemetry is contradicted so that nothing is learnt");
  const std::vector<Counter> left_out = metrics.counters(
      "joulecast_missions_left_out_total", "Missions that nothing was learnt from", "reason",
      std::vector<std::string>(ingest::left_out_names.begin(), ingest::left_out_names.end()));
  const Counter datagrams =
      metrics.counter("joulecast_lcm_datagrams_total", "Datagrams received on the LCM group");
  const std::vector<Counter> lost =
      metrics.counters("joulecast_lcm_datagrams_dropped_total",
                       "Datagrams that gave no message; kernel: lost for want of receive buffer, "
                       "other_channel: LCM traffic of others",
                       "reason",
                       std::vector<std::string>(telemetry::datagram_fault_names.begin(),
                                                telemetry::datagram_fault_names.end()));
  const Gauge queue = metrics.gauge("joulecast_ingest_queue_messages", "Messages waiting to be accounted");
  const Gauge receiving = metrics.gauge("joulecast_ingest_receiving", "1 while LCM is being received");
  const Gauge known =
      metrics.gauge("joulecast_robots_known", "Robots received from since the daemon started");
  const Gauge live = metrics.gauge("joulecast_robots_live", "Robots received from within the last seconds");
  const Gauge fleet_power =
      metrics.gauge("joulecast_fleet_power_watts", "Measured battery power of all live robots");
  const Gauge write_queue =
      metrics.gauge("joulecast_store_queue_commands", "Commands waiting to be committed");
  const Gauge write_bytes = metrics.gauge("joulecast_store_queue_bytes", "Memory that these commands hold");
  const Gauge write_limit =
      metrics.gauge("joulecast_store_queue_limit_bytes", "Memory that they may hold, store.queue_bytes");
  const Counter shed = metrics.counter("joulecast_store_shed_samples_total",
                                       "Raw samples left out of the store because its queue was full");
  const Gauge write_wait =
      metrics.gauge("joulecast_store_oldest_wait_seconds", "Age of the oldest command not yet committed");
  const Gauge healthy = metrics.gauge("joulecast_store_healthy", "1 while commits succeed");
  const Gauge database = metrics.gauge("joulecast_store_bytes", "Size of the database file");
  const Gauge journal = metrics.gauge("joulecast_store_journal_bytes", "Size of the write-ahead log");
  const Gauge telemetry =
      metrics.gauge("joulecast_store_telemetry_bytes", "Encoded raw telemetry and covariates kept");
  const Counter commits = metrics.counter("joulecast_store_commits_total", "Transactions committed");
  const Counter failed = metrics.counter("joulecast_store_failed_commits_total",
                                         "Commit attempts that failed and were tried again");
  const Counter refused = metrics.counter("joulecast_store_refused_total", "Commands that the store refused");
  const Counter seconds = metrics.counter("joulecast_store_commit_seconds_total", "Time spent in commits");
  const Counter pruned_missions =
      metrics.counter("joulecast_store_pruned_missions_total", "Missions dropped by the retention");
  const Counter pruned_events =
      metrics.counter("joulecast_store_pruned_events_total", "Events dropped by the retention");
  const Counter pruned = metrics.counter("joulecast_store_pruned_chunks_total",
                                         "Raw telemetry chunks that the retention dropped");
  const Gauge streams = metrics.gauge("joulecast_event_streams", "Clients of the event stream");
  const Counter dropped = metrics.counter("joulecast_event_streams_dropped_total",
                                          "Clients of the event stream dropped for being slow");

  metrics.before_scrape(
      [=, &counters, &ingest, &fleet, &writer, &store, &events, now = std::move(now_utime_us)] {
        messages.raise_to(static_cast<double>(counters.messages));
        samples.raise_to(static_cast<double>(counters.samples));
        covariates.raise_to(static_cast<double>(counters.covariate_changes));
        for (std::size_t k = 0; k < started.size(); ++k)
          started[k].raise_to(static_cast<double>(counters.missions_started[k]));
        for (std::size_t k = 0; k < ended.size(); ++k)
          ended[k].raise_to(static_cast<double>(counters.missions_ended[k + 1]));
        for (std::size_t k = 0; k < faults.size(); ++k)
          faults[k].raise_to(static_cast<double>(counters.faults[k]));
        for (std::size_t k = 0; k < contradictions.size(); ++k)
          contradictions[k].raise_to(static_cast<double>(counters.contradictions[k]));
        for (std::size_t k = 0; k < left_out.size(); ++k)
          left_out[k].raise_to(static_cast<double>(counters.missions_left_out[k]));
        datagrams.raise_to(static_cast<double>(counters.datagrams.received));
        for (std::size_t k = 0; k < lost.size(); ++k)
          lost[k].raise_to(static_cast<double>(counters.datagrams.faults[k]));
        const ingest::IngestStatus ingesting = ingest.status();
        queue.set(static_cast<double>(ingesting.queue_messages));
        receiving.set(ingesting.receiving ? 1 : 0);

        const auto robots = fleet.all();
        double power = 0;
        double alive = 0, doubtful = 0;
        for (const auto& robot : robots) {
          if (!api::is_live(*robot, now())) continue;
          ++alive;
          doubtful += std::ranges::any_of(robot->contradictions, &ingest::Contradiction::untrue) ? 1 : 0;
          if (robot->measured_power_w == robot->measured_power_w) power += robot->measured_power_w;
        }
        known.set(static_cast<double>(robots.size()));
        live.set(alive);
        contradicted.set(doubtful);
        fleet_power.set(power);

        const history::WriterStatus writing = writer.status();
        write_queue.set(static_cast<double>(writing.queue_commands));
        write_bytes.set(static_cast<double>(writing.queue_bytes));
        write_limit.set(static_cast<double>(writing.queue_limit_bytes));
        shed.raise_to(static_cast<double>(writing.shed_samples));
        write_wait.set(writing.oldest_wait_s);
        healthy.set(writing.healthy ? 1 : 0);
        commits.raise_to(static_cast<double>(writing.commits));
        failed.raise_to(static_cast<double>(writing.failed_commits));
        refused.raise_to(static_cast<double>(writing.refused));
        seconds.raise_to(writing.total_commit_s);
        pruned_missions.raise_to(static_cast<double>(writing.pruned_missions));
        pruned_events.raise_to(static_cast<double>(writing.pruned_events));
        pruned.raise_to(static_cast<double>(writing.pruned_chunks));
        if (const auto size = store.size()) {
          database.set(static_cast<double>(size->database_bytes));
          journal.set(static_cast<double>(size->journal_bytes));
          telemetry.set(static_cast<double>(size->telemetry_bytes));
        }
        const http::EventHub::Counts counted = events.counts();
        streams.set(static_cast<double>(counted.subscribers));
        dropped.raise_to(static_cast<double>(counted.dropped_clients));
      });
}

void export_standby_metrics(Metrics& metrics, const history::Store& store) {
  const Gauge standby_used =
      metrics.gauge("joulecast_store_standby_in_use", "1 while the standby of store.read_url answers");
  const Gauge standby_age = metrics.gauge("joulecast_store_standby_staleness_seconds",
                                          "How old what this standby shows may be; NaN: unknown");
  const Counter standby_answers =
      metrics.counter("joulecast_store_standby_answers_total", "Questions that the standby answered");
  const Counter standby_passed =
      metrics.counter("joulecast_store_standby_passed_on_total",
                      "Questions that the server of store.url answered instead of the standby");
  metrics.before_scrape([=, &store] {
    const auto standby = store.standby();
    if (!standby) return;
    standby_used.set(standby->in_use ? 1 : 0);
    standby_age.set(standby->staleness_s.value_or(std::nan("")));
    standby_answers.raise_to(static_cast<double>(standby->answered));
    standby_passed.raise_to(static_cast<double>(standby->passed_on));
  });
}

}  // namespace joulecast::server
