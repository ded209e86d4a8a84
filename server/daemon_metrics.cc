#include "server/daemon_metrics.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <utility>

#include "server/api/robot_json.h"

namespace joulecast::server {
namespace {

using Series = Metrics::Series;

// Totals by the values of a label, from the `first` value on.
template <class Names, class Totals>
Series by_label(std::string name, std::string help, const std::string& label, const Names& values,
                const Totals& totals, std::size_t first = 0) {
  Series series(std::move(name), std::move(help));
  for (std::size_t k = first; k < std::size(values); ++k)
    series.rows.emplace_back(Labels{{label, std::string(values[k])}}, static_cast<double>(totals[k]));
  return series;
}

// Fields of /proc/self/stat from the third on, proc(5): the second, the program's name, may hold spaces.
std::vector<double> stat_fields() {
  std::ifstream file("/proc/self/stat");
  std::string text{std::istreambuf_iterator<char>(file), {}};
  text.erase(0, text.rfind(')') + 1);
  std::istringstream words(text);
  std::string state;
  words >> state;
  return {std::istream_iterator<double>(words), {}};
}

double boot_time_s() {
  std::ifstream file("/proc/stat");
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("btime ")) return std::stod(line.substr(6));
  return 0;
}

double open_files() {
  std::error_code ignored;
  const std::filesystem::directory_iterator entries("/proc/self/fd", ignored);
  return static_cast<double>(std::distance(begin(entries), end(entries)));
}

// In the order of the enumeration.
enum Place { live, silent, power, modelled, charge, drawn, returned, ledger, ratio };

AllSeries empty_series() {
  return {
      {"joulecast_robot_live", "1 while the robot's telemetry arrives"},
      {"joulecast_robot_silent_seconds", "Time since the robot's last message"},
      {"joulecast_robot_power_watts", "Measured power out of the battery, while live"},
      {"joulecast_robot_modelled_power_watts", "Modelled power out of the battery, while live"},
      {"joulecast_robot_charge_ratio", "State of charge, 0 to 1; of a silent robot the last one"},
      {"joulecast_robot_drawn_joules_total", "Energy out of the battery within missions"},
      {"joulecast_robot_returned_joules_total", "Energy back into the battery within missions"},
      {"joulecast_robot_ledger_joules", "Battery energy within missions by term; recovered counts negative"},
      {"joulecast_robot_energy_ratio", "Measured over modelled energy, median of the newest missions"},
  };
}

}  // namespace

static_assert(history::MissionState{} == history::MissionState::open);

history::StoreSize StoreSizes::read() {
  constexpr std::chrono::milliseconds longest_wait{100};
  if (!reading_.valid()) reading_ = std::async(std::launch::async, [this] { return store_.size(); });
  if (reading_.wait_for(longest_wait) == std::future_status::ready)
    if (const Result<history::StoreSize> size = reading_.get()) last_ = *size;
  return last_;
}

AllSeries message_series(const ingest::IngestCounters& counters, const ingest::IngestService& ingest) {
  const ingest::IngestStatus status = ingest.status();
  return {
      {"joulecast_ingest_messages_total", "Messages received on the robots' channels",
       counters.messages.load()},
      {"joulecast_ingest_samples_total", "Samples accounted for", counters.samples.load()},
      {"joulecast_ingest_covariate_changes_total", "Changes of covariates within missions",
       counters.covariate_changes.load()},
      by_label("joulecast_ingest_faults_total", "Messages, samples and events refused or repaired", "reason",
               ingest::ingest_fault_names, counters.faults),
      by_label("joulecast_contradictions_total",
               "Reported contradictions of robots' telemetry, each at most once per hour", "kind",
               ingest::contradiction_kind_names, counters.contradictions),
      {"joulecast_lcm_datagrams_total", "Datagrams received on the LCM group",
       counters.datagrams.received.load()},
      by_label("joulecast_lcm_datagrams_dropped_total",
               "Datagrams that gave no message; kernel: lost for want of receive buffer, other_channel: LCM "
               "traffic of others",
               "reason", telemetry::datagram_fault_names, counters.datagrams.faults),
      {"joulecast_ingest_queue_messages", "Messages waiting to be accounted", status.queue_messages},
      {"joulecast_ingest_receiving", "1 while LCM is being received", status.receiving}};
}

AllSeries mission_series(const ingest::IngestCounters& counters) {
  return {by_label("joulecast_missions_started_total", "Missions begun", "kind",
                   std::array{"announced", "implicit"}, counters.missions_started),
          // But for the first state, open.
          by_label("joulecast_missions_ended_total", "Missions ended", "state",
                   history::names_of<history::MissionState>, counters.missions_ended, 1),
          by_label("joulecast_missions_left_out_total", "Missions that were not used for training", "reason",
                   ingest::left_out_names, counters.missions_left_out)};
}

AllSeries fleet_series(const ingest::FleetView& fleet, std::int64_t now_utime_us) {
  const auto robots = fleet.all();
  std::size_t heard = 0, contradicted = 0;
  double power_w = 0;
  for (const auto& robot : robots) {
    if (!api::is_live(*robot, now_utime_us)) continue;
    ++heard;
    contradicted += std::ranges::any_of(robot->contradictions, &ingest::Contradiction::untrue) ? 1 : 0;
    if (!std::isnan(robot->measured_power_w)) power_w += robot->measured_power_w;
  }
  return {{"joulecast_robots_known", "Robots received from since the daemon started", robots.size()},
          {"joulecast_robots_live", "Robots received from within the last seconds", heard},
          {"joulecast_fleet_power_watts", "Measured battery power of all live robots", power_w},
          {"joulecast_contradicted_robots",
           "Live robots with contradicted telemetry, which is not used for training", contradicted}};
}

AllSeries writer_series(const history::Writer& writer) {
  const auto s = writer.status();
  return {
      {"joulecast_store_queue_commands", "Commands waiting to be committed", s.queue_commands},
      {"joulecast_store_queue_bytes", "Memory that these commands hold", s.queue_bytes},
      {"joulecast_store_queue_limit_bytes", "Memory that they may hold, store.queue_bytes",
       s.queue_limit_bytes},
      {"joulecast_store_shed_samples_total", "Raw samples left out of the store because its queue was full",
       s.shed_samples},
      {"joulecast_store_oldest_wait_seconds", "Age of the oldest command not yet committed", s.oldest_wait_s},
      {"joulecast_store_healthy", "1 while commits succeed", s.healthy},
      {"joulecast_store_commits_total", "Transactions committed", s.commits},
      {"joulecast_store_failed_commits_total", "Commit attempts that failed and were tried again",
       s.failed_commits},
      {"joulecast_store_refused_total", "Commands that the store refused", s.refused},
      {"joulecast_store_commit_seconds_total", "Time spent in commits", s.total_commit_s},
      {"joulecast_store_pruned_missions_total", "Missions dropped by the retention", s.pruned_missions},
      {"joulecast_store_pruned_events_total", "Events dropped by the retention", s.pruned_events},
      {"joulecast_store_pruned_audit_entries_total", "Entries of the audit dropped by the retention",
       s.pruned_audit},
      {"joulecast_store_pruned_chunks_total", "Raw telemetry chunks that the retention dropped",
       s.pruned_chunks}};
}

AllSeries store_series(const history::StoreSize& size) {
  return {
      {"joulecast_store_bytes", "Size of the database file", size.database_bytes},
      {"joulecast_store_journal_bytes", "Size of the write-ahead log", size.journal_bytes},
      {"joulecast_store_telemetry_bytes", "Encoded raw telemetry and covariates kept", size.telemetry_bytes}};
}

AllSeries stream_series(const http::EventHub& events) {
  const auto s = events.counts();
  return {{"joulecast_event_streams", "Clients of the event stream", s.subscribers},
          {"joulecast_event_streams_dropped_total", "Clients of the event stream dropped for being slow",
           s.dropped_clients}};
}

AllSeries process_series() {
  Series build{"joulecast_build_info", "1; the labels contain the version and the compiler"};
  build.rows = {{{{"version", JOULECAST_VERSION}, {"compiler", "g++ " __VERSION__}}, 1}};
  const std::vector<double> stat = stat_fields();
  if (stat.size() < 21) return {build};
  // Its fields are counted from 1, and the first of `stat` is the fourth.
  const auto field = [&](std::size_t number) { return stat[number - 4]; };
  const auto ticks = static_cast<double>(sysconf(_SC_CLK_TCK));
  rlimit files{};
  getrlimit(RLIMIT_NOFILE, &files);
  return {
      build,
      {"process_cpu_seconds_total", "User and system CPU time", (field(14) + field(15)) / ticks},
      {"process_start_time_seconds", "Start of the process since 1970", boot_time_s() + field(22) / ticks},
      {"process_threads", "Threads", field(20)},
      {"process_virtual_memory_bytes", "Virtual memory", field(23)},
      {"process_resident_memory_bytes", "Resident memory",
       field(24) * static_cast<double>(sysconf(_SC_PAGESIZE))},
      {"process_open_fds", "Open file descriptors", open_files()},
      {"process_max_fds", "Limit of open file descriptors", static_cast<double>(files.rlim_cur)},
  };
}

AllSeries cluster_series(const Cluster& cluster) {
  const auto s = cluster.status();
  return {
      {"joulecast_cluster_members", "Daemons of the cluster that renew their memberships",
       std::ranges::count_if(s.state.members, [](const auto& m) { return m.expires_in_s > 0; })},
      {"joulecast_cluster_robots_kept", "Robots that this daemon keeps", s.kept},
      {"joulecast_cluster_robots_free", "Robots that no daemon keeps for now",
       std::ranges::count_if(s.state.leases,
                             [&](const history::Lease& lease) {
                               return std::ranges::find(s.state.members, lease.node,
                                                        &history::Member::node) == s.state.members.end();
                             })},
      {"joulecast_cluster_renewed_age_seconds", "Time since this daemon last renewed its membership",
       s.renewed_s},
      {"joulecast_cluster_held_messages", "Messages held of robots that other daemons keep, for a takeover",
       s.held_messages},
      {"joulecast_cluster_held_bytes", "Memory that these hold", s.held_bytes},
      {"joulecast_cluster_held_messages_dropped_total", "Held messages discarded from a full queue",
       s.held_dropped},
      {"joulecast_cluster_takeovers_total", "Robots that this daemon took over from failed daemons",
       s.takeovers},
      {"joulecast_cluster_handovers_total",
       "Robots that this daemon handed to another that joined or receives them", s.handovers},
      {"joulecast_cluster_missions_resumed_total", "Open missions that this daemon took over",
       s.resumed_missions},
      {"joulecast_cluster_commands_dropped_total",
       "Commands of this daemon that were not stored: another one keeps the robot now", s.dropped_commands},
      {"joulecast_cluster_memberships_lost_total",
       "Times that this daemon was away for longer than cluster.lease_s", s.memberships_lost}};
}

AllSeries gap_series(const DiagnosisService& diagnoses, const GapWatch& watch,
                     const ModelAdoption& adoption) {
  const DiagnosisCounts jobs = diagnoses.counts();
  const WatchCounts seen = watch.counts();
  const AdoptionCounts models = adoption.counts();
  return {
      by_label("joulecast_diagnoses_ended_total", "Diagnoses that ended since the start", "state",
               std::array{"done", "failed", "cancelled"}, std::array{jobs.done, jobs.failed, jobs.cancelled}),
      {"joulecast_diagnosis_seconds_total", "Time spent on diagnoses", jobs.seconds},
      {"joulecast_diagnoses_waiting", "Waiting diagnoses", jobs.waiting},
      {"joulecast_diagnosis_running", "1 while a diagnosis runs", jobs.running},
      {"joulecast_gap_watch_rounds_total", "Examinations of all robots' missions", seen.rounds},
      {"joulecast_gap_drifts_total", "Drifts of the gap found", seen.drifts},
      {"joulecast_gap_drifting_robots", "Robots with a drift of the gap under their model in force",
       seen.drifting},
      {"joulecast_gap_outlying_robots", "Robots that differ significantly from the others of their kind",
       seen.standing_out},
      {"joulecast_gap_ratio_min", "Smallest of the robots' measured over modelled energy, newest missions",
       seen.ratio_min},
      {"joulecast_gap_ratio_median", "Median of the robots' measured over modelled energy",
       seen.ratio_median},
      {"joulecast_gap_ratio_max", "Greatest of the robots' measured over modelled energy", seen.ratio_max},
      by_label("joulecast_models_tested_total", "Models that were back-tested to be adopted", "outcome",
               std::array{"adopted", "forced", "refused"},
               std::array{models.adopted, models.forced, models.refused})};
}

AllSeries attention_series(const api::AttentionList& list) {
  Series all{"joulecast_attention",
             "Robots, or the service, on the attention list and not acknowledged, by severity"};
  for (const std::string_view severity : api::severity_names)
    all.rows.emplace_back(Labels{{"severity", std::string(severity)}}, 0);
  for (const api::AttentionEntry& entry : list.entries())
    if (const api::AttentionReason& worst = entry.reasons.front(); !worst.acknowledged)
      ++all.rows[static_cast<std::size_t>(worst.severity)].second;
  return AllSeries{std::move(all)};
}

AllSeries mqtt_series(const BatteryTopics& topics) {
  const auto s = topics.status();
  return {{"joulecast_mqtt_connected", "Whether the MQTT broker is connected", s.connected},
          {"joulecast_mqtt_connections_total", "Connections made to the MQTT broker", s.connections},
          {"joulecast_mqtt_published_total", "Battery messages handed to the MQTT broker", s.published},
          {"joulecast_mqtt_failed_total", "Messages that were not, since the connection was lost", s.failed}};
}

AllSeries robot_series(const ingest::FleetView& fleet, const GapWatch& watch, std::int64_t now_utime_us,
                       std::size_t most_robots) {
  const auto robots = fleet.all();
  const std::size_t shown = std::min(most_robots, robots.size());
  const Series left_out{"joulecast_robots_without_metrics",
                        "Robots beyond metrics.robots, without metrics of their own", robots.size() - shown};
  if (most_robots == 0) return AllSeries{left_out};
  AllSeries all = empty_series();
  const std::map<std::string, double> ratios = watch.counts().ratios;
  for (std::size_t k = 0; k < shown; ++k) {
    const ingest::RobotSnapshot& robot = *robots[k];
    const Labels labels{{"robot_id", robot.robot_id}};
    const auto add = [&](Place place, double value) {
      if (std::isfinite(value)) all[place].rows.emplace_back(labels, value);
    };
    const bool is_live = api::is_live(robot, now_utime_us);
    add(live, is_live ? 1 : 0);
    if (robot.received_utime_us > 0)
      add(silent,
          1e-6 * static_cast<double>(std::max<std::int64_t>(0, now_utime_us - robot.received_utime_us)));
    if (is_live) add(power, robot.measured_power_w);
    if (is_live) add(modelled, robot.modelled_power_w);
    add(charge, robot.state_of_charge);
    add(drawn, robot.drawn_j);
    add(returned, robot.returned_j);
    if (const auto found = ratios.find(robot.robot_id); found != ratios.end()) add(ratio, found->second);
    for (std::size_t term = 0; term < signals::term_count; ++term)
      all[ledger].rows.emplace_back(
          Labels{{"robot_id", robot.robot_id}, {"term", std::string(signals::term_names[term])}},
          robot.ledger.value[term]);
  }
  all.push_back(left_out);
  return all;
}

AllSeries webhook_series(const Webhooks& webhooks) {
  AllSeries all{{"joulecast_webhook_delivered_total", "Events delivered"},
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
}

}  // namespace joulecast::server
