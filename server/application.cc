#include "server/application.h"

#include <linux/magic.h>
#include <sys/statfs.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <functional>
#include <future>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>
#include <vector>

#include "answers/autonomy.h"
#include "answers/mission.h"
#include "base/fault_boundary.h"
#include "base/host_clock.h"
#include "base/try.h"
#include "history/open_store.h"
#include "history/spool.h"
#include "history/writer.h"
#include "ingest/charge_watch.h"
#include "ingest/contradiction_watch.h"
#include "ingest/ingest_service.h"
#include "ingest/keeping.h"
#include "ingest/model_registry.h"
#include "ingest/refinement_watch.h"
#include "ingest/stored_robot.h"
#include "server/api/change.h"
#include "server/api/robot_json.h"
#include "server/api/services.h"
#include "server/cluster/cluster.h"
#include "server/daemon_metrics.h"
#include "server/diagnosis/proposal_review.h"
#include "server/embedded.h"
#include "server/http/event_hub.h"
#include "server/http/gate.h"
#include "server/http/http_server.h"
#include "server/http/openapi.h"
#include "server/http/operations.h"
#include "server/http/static_files.h"
#include "server/http/text.h"
#include "server/logging.h"
#include "server/metrics.h"

namespace joulecast {
namespace {

// Name of the network file system that has the path, or the folder to create it in; empty: none.
std::string_view network_file_system(const std::string& path) {
  static constexpr std::pair<std::uint32_t, std::string_view> kinds[] = {
      {NFS_SUPER_MAGIC, "NFS"},    {SMB_SUPER_MAGIC, "SMB"}, {CIFS_SUPER_MAGIC, "SMB"},
      {SMB2_SUPER_MAGIC, "SMB"},   {AFS_SUPER_MAGIC, "AFS"}, {AFS_FS_MAGIC, "AFS"},
      {CODA_SUPER_MAGIC, "Coda"},  {V9FS_MAGIC, "9P"},       {CEPH_SUPER_MAGIC, "CephFS"},
      {OCFS2_SUPER_MAGIC, "OCFS2"}};
  struct statfs info {};
  std::string folder = std::filesystem::path(path).parent_path().string();
  if (folder.empty()) folder = ".";
  if (statfs(path.c_str(), &info) != 0 && statfs(folder.c_str(), &info) != 0) return "";
  const auto* kind = std::ranges::find(kinds, static_cast<std::uint32_t>(info.f_type),
                                       &std::pair<std::uint32_t, std::string_view>::first);
  return kind != std::end(kinds) ? kind->second : "";
}

using std::chrono::milliseconds;

// Stores the data that the last daemon could not store. Data that the store refuses are kept aside. While the
// spool cannot be read or stored, this daemon must not run: its changes would make the spool out of date.
Result<void> take_in_spool(const std::string& path, history::Store& store) {
  const Result<history::TakenSpool> taken = history::take_in_spool(
      path, store, [](const Error& refused) { log_error("a command of the spool was refused", refused); });
  if (!taken) {
    log_error("the spool was not stored", taken.error());
    const bool aside = taken.error().fault == Fault::corrupt || taken.error().fault == Fault::conflict;
    return aside ? Result<void>() : tl::unexpected(taken.error());
  }
  if (taken->commands == 0) return {};
  const auto count = [](std::size_t commands) { return std::to_string(commands); };
  if (taken->before)
    log_info("the spool was stored before", {{"path", path}, {"commands", count(taken->commands)}});
  else
    log_info("spool taken in", {{"path", path},
                                {"commands", count(taken->commands)},
                                {"stored_before", count(taken->already)},
                                {"refused", count(taken->refused)},
                                {"dropped", count(taken->fenced)}});
  if (!taken->kept_as.empty())
    log_error("not all of the spool was stored",
              {{"kept_as", taken->kept_as},
               {"refused", count(taken->refused)},
               {"dropped_as_another_daemon_keeps_the_robot", count(taken->fenced)},
               {"of_them_samples_stored", count(taken->samples)}});
  return {};
}

// Runs work on its own thread. False if it did not end in time: it continues, and only _exit() ends all.
bool within(milliseconds limit, std::function<void()> work) {
  auto done = std::make_shared<std::promise<void>>();
  std::future<void> ended = done->get_future();
  std::thread([done, work = std::move(work)] {
    work();
    done->set_value();
  }).detach();
  return ended.wait_for(limit) == std::future_status::ready;
}

// Writes changes and rejected requests to the store's audit log.
std::function<Result<void>(http::AccessEvent)> audit_into(history::Writer& writer) {
  return [&writer](http::AccessEvent event) {
    return writer.offer(history::AppendAudit{{0, host_utime_us(), std::move(event.actor),
                                              std::move(event.address), std::move(event.request_id),
                                              std::move(event.action), std::move(event.detail_json), ""}});
  };
}

// The answers of requests with idempotency keys, in the store.
api::IdempotencyKeys::Options answers_in(const history::Store& store, history::Writer& writer,
                                         milliseconds wait) {
  return {
      .find = [&store](const std::string& actor, const std::string& key) { return store.answer(actor, key); },
      .keep =
          [&writer](history::RequestAnswer answer) {
            answer.utime_us = host_utime_us();
            if (const auto kept = writer.execute(history::KeepAnswer{std::move(answer)}); !kept)
              log_error("the answer of a request was not stored under its idempotency key", kept.error());
          },
      .wait = wait};
}

void log_failed_request(const http::Endpoint& endpoint, const http::Request& request, const Error& error) {
  log_error("request failed",
            {{"operation", endpoint.operation_id}, {"request_id", request.id}, {"cause", describe(error)}});
}

// Every documented endpoint and the page.
Result<std::vector<http::Endpoint>> endpoint_table(api::Services& services, Metrics& metrics,
                                                   http::EventHub& events, http::Gate& gate,
                                                   const api::IdempotencyKeys& keys,
                                                   std::vector<http::ReadinessCheck> checks,
                                                   const std::string& web_directory) {
  std::vector<http::Endpoint> table;
  const auto add = [&table](std::vector<http::Endpoint> rows) {
    table.insert(table.end(), std::make_move_iterator(rows.begin()), std::make_move_iterator(rows.end()));
  };
  for (http::Endpoint& row : api::endpoints(&services))
    table.push_back(gate.audited(keys.honoured(std::move(row))));
  add(gate.session_endpoints());
  add({http::events_endpoint(events)});
  add(http::operations_endpoints(metrics, std::move(checks)));
  TRY_ASSIGN(table, http::with_openapi(std::move(table), api::schemas(), embedded_examples()));
  TRY_ASSIGN(auto page, web_directory.empty() ? http::asset_endpoints(embedded_web())
                                              : http::asset_endpoints_from(web_directory));
  add(std::move(page));
  add(http::asset_endpoints(embedded_reference()));
  return table;
}

// The data of the event `mission`, for a mission that has ended.
std::string mission_event(const history::Mission& mission) {
  return http::rounded(answers::mission_table().text(mission));
}

}  // namespace

// Publishes changes of the fleet to the event stream: `state` for each robot with a new snapshot,
// `contradiction` for each published contradiction, `mission` for each mission that ended at another daemon
// of the cluster. Keeps the last values of each robot. One thread.
class FleetEvents {
 public:
  // `own`: robots whose missions this daemon writes; empty: all.
  FleetEvents(const api::Services& services, ingest::RecentValues& recent, http::EventHub& hub,
              std::function<bool(const std::string&)> own)
      : services_(services), recent_(recent), hub_(hub), own_(std::move(own)) {}

  void publish(std::int64_t now_utime_us) {
    std::erase_if(published_, [&](const auto& each) { return services_.fleet.find(each.first) == nullptr; });
    recent_.keep([&](const std::string& id) { return services_.fleet.find(id) != nullptr; });
    for (const auto& snapshot : services_.fleet.all()) {
      recent_.take(*snapshot);
      Published& published = published_[snapshot->robot_id];
      const bool live = api::is_live(*snapshot, now_utime_us);
      publish_ended(*snapshot, published);
      if (published.snapshot == snapshot && published.live == live) continue;
      publish_contradictions(*snapshot, published);
      const auto model = services_.models.find(snapshot->robot_id);
      std::optional<forecast::Reach> reach;
      if (model != nullptr) reach = services_.forecasts.reach(model, *snapshot);
      hub_.publish("state", http::rounded(api::state_table().text({*snapshot, reach, now_utime_us})),
                   snapshot->robot_id, http::EventHub::Of::state);
      published.snapshot = snapshot;
      published.live = live;
    }
  }

 private:
  struct Published {
    std::shared_ptr<const ingest::RobotSnapshot> snapshot;
    bool live = false;
    std::map<std::string, std::int64_t> contradictions;  // host's time when each was published
    std::vector<history::MissionKey> ended;              // at other daemons; perhaps not stored yet
  };
  void publish_contradictions(const ingest::RobotSnapshot& now, Published& published) {
    for (const ingest::Contradiction& c : now.contradictions) {
      std::int64_t& last = published.contradictions[c.id + ' ' + c.channel];
      if (last == c.told_utime_us) continue;
      last = c.told_utime_us;
      hub_.publish("contradiction", http::rounded(api::contradiction_event_table().text({now.robot_id, c})),
                   now.robot_id);
    }
  }
  void publish_ended(const ingest::RobotSnapshot& now, Published& published) {
    if (const auto& before = published.snapshot; own_ && !own_(now.robot_id) && before != nullptr &&
                                                 before->mission_key > 0 &&
                                                 before->mission_key != now.mission_key)
      published.ended.push_back(before->mission_key);
    std::erase_if(published.ended, [&](history::MissionKey key) {
      const auto mission = services_.store.mission(key);
      if (!mission) return mission.error().fault == Fault::not_found;
      if (mission->state == history::MissionState::open) return false;
      hub_.publish("mission", mission_event(*mission), now.robot_id);
      return true;
    });
  }

  const api::Services& services_;
  ingest::RecentValues& recent_;
  http::EventHub& hub_;
  const std::function<bool(const std::string&)> own_;
  std::map<std::string, Published> published_;
};

// In the order of construction; destroyed in reverse.
struct Application::Parts {
  explicit Parts(const DaemonOptions& o)
      : options(o), events(o.events), warn([](const std::string& robot, const std::string& text) {
          log_warning(text, {{"robot_id", robot}});
        }) {}

  ~Parts() {
    (void)stop();  // parts that did not end are logged; a caller that needs the result calls stop() before
    observe_faults({});
  }

  Result<void> open_history() {
    const bool by_path = options.store_url.empty();
    TRY_ASSIGN(server::ClusterOptions wanted, cluster_options(options));
    if (!wanted.name.empty()) in_cluster = std::move(wanted);
    history::StoreOptions options_of_store = options.store;
    options_of_store.query_limit = options.http.request_deadline;
    if (in_cluster) {
      options_of_store.shared_writer = in_cluster->writer;
      options_of_store.on_dropped = [this](const std::string& robot_id, history::Epoch epoch,
                                           std::uint64_t count) {
        if (joined) cluster->on_dropped(robot_id, epoch, count);
      };
    }
    auto opened = history::open_store(in_cluster ? in_cluster->url : store_url(options), options_of_store);
    if (!opened)
      return fail(opened.error().fault, by_path ? "store.path" : "store.url",
                  std::move(opened.error().message));
    store = std::move(*opened);
    warn_of_network_file_system();
    TRY(take_in_spool(spool_path(options), *store));
    TRY(open_webhooks());
    history::WriterOptions writing = options.writer;
    writing.spool_path = spool_path(options);
    if (in_cluster) writing.prunes = [this] { return joined && cluster->is_first(); };
    if (webhooks)
      writing.on_event = [&hooks = *webhooks](const history::Event& event) {
        hooks.offer(event.kind, event.robot_id, event.utime_us, event.detail_json);
      };
    writing.on_reused_name = [this](const history::Mission& begun, history::MissionKey earlier) {
      ingest::report_reused_name(begun, earlier, host_utime_us(), counters,
                                 [this](history::Command command) { offer(std::move(command)); });
    };
    writing.on_mission_ended = [this](const history::Mission& mission) {
      survive("mission events", [&] {
        const std::string text = mission_event(mission);
        events.publish("mission", text, mission.robot_id);
        if (webhooks) webhooks->offer("mission", mission.robot_id, mission.end_utime_us, text);
      });
    };
    writer = std::make_unique<history::Writer>(*store, std::move(writing));
    tell_of_faults();

    const std::string& directory = options.robots_directory;
    Result<void> loaded = directory.empty() ? Result<void>() : load_robot_files(directory);
    if (loaded) loaded = ingest::load_stored_models(*store, models);
    return loaded ? recall_states() : loaded;
  }

  // Locks and syncs of SQLite need a local file system: https://www.sqlite.org/useovernet.html
  void warn_of_network_file_system() {
    const Result<std::string> path = store_file(options);
    if (!path) return;
    const std::string_view kind = network_file_system(*path);
    if (kind.empty()) return;
    log_warning(
        "the SQLite store is on a network file system, which can damage it: use a local disk or PostgreSQL",
        {{"path", *path}, {"file_system", std::string(kind)}});
  }

  Result<void> open_webhooks() {
    if (options.webhooks_file.empty()) return {};
    TRY_ASSIGN(auto read, server::read_webhooks(options.webhooks_file));
    webhooks = std::make_unique<server::Webhooks>(std::move(read), options.webhooks);
    metrics.series([this] { return server::webhook_series(*webhooks); });
    return {};
  }

  void offer(history::Command command) {
    if (const Result<void> posted = writer->offer(std::move(command)); !posted)
      warn("", describe(posted.error()));
  }

  Result<void> start_ingest() {
    const auto post = [this](history::Command command) { offer(std::move(command)); };
    ingest::SessionOutputs outputs{*store, post, fleet, counters, warn};
    outputs.mission_ended = [this](const ingest::SessionOutputs::Post& store_it,
                                   const std::shared_ptr<const ingest::ModelInForce>& model,
                                   forecast::PastMission mission) {
      // A mission during which the version changed is used for training with the version in force now.
      const auto in_force = models.find(model->robot.robot_id);
      store_it(
          history::PutLearned{forecasts->learn(in_force != nullptr ? in_force : model, std::move(mission))});
      watch->mission_ended(model->robot.robot_id);
      review->mission_ended(model->robot.robot_id);
    };
    outputs.prepare = [this](const std::string& robot_id) { return forecasts->read(models.find(robot_id)); };
    outputs.last_change = [this](const std::string& robot_id) { return watch->last_change(robot_id); };
    outputs.suggest = [this](history::Proposal candidate) { review->suggest(std::move(candidate)); };
    ingest = std::make_unique<ingest::IngestService>(options.ingest, models, *forecasts, outputs,
                                                     in_cluster ? &keeping : nullptr);
    if (in_cluster) make_cluster();
    return ingest->start();
  }

  // Its threads start when everything else answers.
  void make_cluster() {
    cluster = std::make_unique<server::Cluster>(
        *in_cluster,
        server::Cluster::Parts{*store, keeping, fleet, models, *forecasts, host_utime_us,
                               [this](const std::string& robot_id, const ingest::MissionRequest& request) {
                                 ingest->request_mission(robot_id, request);
                               },
                               [](const std::string& text) { log_warning(text, {}); },
                               [this](std::int64_t id) {
                                 if (const Result<void> taken = diagnoses->take_over(id); !taken)
                                   log_error("a diagnosis left by another daemon", taken.error());
                               }});
  }

  Result<void> join_cluster() {
    if (!in_cluster) return {};
    const std::string scheme = options.http.tls.certificate.empty() ? "http://" : "https://";
    Result<void> done = cluster->start(scheme + options.http.address + ":" + std::to_string(http->port()));
    joined = done.has_value();
    return done;
  }

  Result<void> start_mqtt() {
    if (options.mqtt_url.empty()) return {};
    TRY_ASSIGN(server::BatteryTopics::Options topics, mqtt_options(options));
    batteries = std::make_unique<server::BatteryTopics>(
        std::move(topics),
        [this, request = nlohmann::json{
                   {"dialect", answers::dialect_names[static_cast<std::size_t>(options.mqtt.dialect)]}}] {
          return live_batteries(request);
        });
    metrics.series([this] { return server::mqtt_series(*batteries); });
    return batteries->start();
  }

  std::vector<server::BatteryTopics::Battery> live_batteries(const nlohmann::json& request) {
    std::vector<server::BatteryTopics::Battery> all;
    const std::int64_t now = host_utime_us();
    const auto own = is_own();
    for (const auto& snapshot : fleet.all()) {
      const auto model = models.find(snapshot->robot_id);
      if (model == nullptr || !api::is_live(*snapshot, now)) continue;
      if (own && !own(snapshot->robot_id)) continue;
      // Fails, and is not published, without a state of charge.
      auto object = answers::autonomy_answer(request, forecasts->of(model), api::live_robot(snapshot.get()),
                                             cost_tables);
      if (object) all.push_back({snapshot->robot_id, std::move(*object)});
    }
    return all;
  }

  // True for robots that this daemon keeps; empty if it is in no cluster, for all robots.
  std::function<bool(const std::string&)> is_own() {
    if (!in_cluster) return {};
    return [this](const std::string& robot_id) { return keeping.epoch_of(robot_id) != 0; };
  }

  Result<void> start_diagnosis() {
    forecasts = std::make_unique<ingest::Forecasts>(*store);
    forecasts->set_siblings_pending(true);
    drift_view = std::make_unique<server::DriftView>(*store, models, options.drift);
    const server::Parts parts{*store,        *writer,
                              models,        *drift_view,
                              host_utime_us, [](const Error& error) { log_error("diagnosis", error); }};
    server::AdoptionOptions adopting = options.adoption;
    adopting.meter = options.ingest.session.meter;
    adoption = std::make_unique<server::ModelAdoption>(parts, adopting);
    review = std::make_unique<server::ProposalReview>(
        parts, *adoption, server::ReviewOptions{options.adopts_automatically, warn});
    review->start();
    diagnoses = std::make_unique<server::DiagnosisService>(
        parts, options.diagnosis,
        [this](const history::DiagnosisRecord& diagnosis) { watch->on_diagnosis(diagnosis); });
    server::WatchOptions watching = options.watch;
    watching.is_own = is_own();
    watch = std::make_unique<server::GapWatch>(parts, *forecasts, *diagnoses, watching);
    Result<void> started = diagnoses->start();
    if (started) watch->start();
    return started;
  }

  std::vector<http::ReadinessCheck> readiness_checks() {
    std::vector<http::ReadinessCheck> checks;
    // `why_not` is the reason for which a part is not ready; empty: it is.
    const auto add = [&checks](std::string name, std::string field, std::function<std::string()> why_not) {
      checks.push_back({std::move(name), [field = std::move(field), why_not = std::move(why_not)] {
                          const std::string why = why_not();
                          return why.empty() ? Result<void>() : fail(Fault::unavailable, field, why);
                        }});
    };
    add("ingest", "ingest", [this] {
      const ingest::IngestStatus status = ingest->status();
      return status.receiving ? std::string() : "LCM is not being received: " + status.error;
    });
    add("store", "store", [this] { return writer->status().error; });
    add("forecasts", "forecasts", [this] {
      return std::string(forecasts->siblings_pending() ? "missions of robots are still being read" : "");
    });
    if (in_cluster) add("cluster", "cluster", [this] { return cluster->status().error; });
    if (!options.ingest.signatures.key_file.empty())
      add("robot_keys", "ingest.key_file", [this] { return ingest->status().key_error; });
    if (!options.token_file.empty()) checks.push_back({"tokens", [this] { return gate->check(); }});
    return checks;
  }

  void export_all_metrics() {
    sizes = std::make_unique<server::StoreSizes>(*store);
    metrics.series([this] { return server::message_series(counters, *ingest); });
    metrics.series([this] { return server::mission_series(counters); });
    metrics.series([this] { return server::fleet_series(fleet, host_utime_us()); });
    metrics.series([this] { return server::writer_series(*writer); });
    // joulecast_store_healthy reports a store whose sizes cannot be read.
    metrics.series([this] { return server::store_series(sizes->read()); });
    metrics.series([this] { return server::stream_series(events); });
    metrics.series([this] { return server::gap_series(*diagnoses, *watch, *adoption); });
    metrics.series([this] { return server::attention_series(*attention); });
    if (cluster) metrics.series([this] { return server::cluster_series(*cluster); });
    metrics.series(server::process_series);
    metrics.series([this]() -> server::AllSeries {
      return {{"joulecast_robot_files_faulty", "Faulty robot files that were skipped at the start",
               faulty_files}};
    });
    metrics.series(
        [this] { return server::robot_series(fleet, *watch, host_utime_us(), options.robots_with_metrics); });
  }

  // NaN for 0, which is the value of a setting that is not set.
  static double positive(double value) { return value > 0 ? value : signals::unmeasured; }

  Result<void> start_http() {
    services = std::make_unique<api::Services>(api::Services{
        .store = *store,
        .writer = *writer,
        .models = models,
        .fleet = fleet,
        .recent = recent,
        .forecasts = *forecasts,
        .cost_tables = cost_tables,
        .drift = *drift_view,
        .adoption = *adoption,
        .diagnoses = *diagnoses,
        .watch = *watch,
        .cluster = cluster.get(),
        .now_utime_us = host_utime_us,
        .request_mission =
            [this](const std::string& robot_id, const ingest::MissionRequest& request) {
              ingest->request_mission(robot_id, request);
            },
        .tariff = {positive(options.price_per_kwh), options.currency, positive(options.co2_g_per_kwh)}});
    attention = std::make_unique<api::AttentionList>(
        *services, is_own(), [](const Error& error) { log_error("attention", error); });
    services->attention = attention.get();
    attention->start();
    TRY_ASSIGN(gate, http::Gate::open({.token_file = options.token_file,
                                       .now_utime_us = host_utime_us,
                                       .audit = audit_into(*writer),
                                       .not_audited = [](const http::AccessEvent& event, const Error& error) {
                                         log_error("not audited", {{"operation", event.action},
                                                                   {"request_id", event.request_id},
                                                                   {"actor", event.actor},
                                                                   {"cause", describe(error)}});
                                       }}));
    idempotency =
        std::make_unique<api::IdempotencyKeys>(answers_in(*store, *writer, options.http.request_deadline));
    TRY_ASSIGN(auto table, endpoint_table(*services, metrics, events, *gate, *idempotency, readiness_checks(),
                                          options.web_directory));
    router = std::make_unique<http::Router>(std::move(table), log_failed_request,
                                            [this](const http::Endpoint& endpoint, http::Request& request) {
                                              return gate->refuse(endpoint, request);
                                            });
    http_metrics = std::make_unique<http::HttpMetrics>(metrics);
    export_all_metrics();
    TRY_ASSIGN(http, http::HttpServer::start(options.http, *router, http_metrics.get()));
    return {};
  }

  // Reports exceptions that a thread survived as a log line, a count and an entry of the event log.
  void tell_of_faults() {
    prometheus::Counter& survived =
        metrics.counter("joulecast_internal_faults_total",
                        "Exceptions that a thread survived: each cost one message, one commit or one job");
    observe_faults([&survived, &writer = *writer](std::string_view part, std::string_view why) {
      survived.Increment();
      log_error("internal fault", Error{Fault::internal, std::string(part), std::string(why)});
      JsonWriter detail;
      detail.begin_object().field("part", part).field("why", why).end_object();
      if (const auto kept =
              writer.offer(history::AppendEvent{{0, host_utime_us(), "", "internal_fault", detail.take()}});
          !kept)
        log_error("internal fault is not in the event log", kept.error());
    });
  }

  // Parts that do not end in time are abandoned, so that the store is always closed.
  bool stop() {
    if (stopped.exchange(true)) return true;
    if (cluster) cluster->settle_down();
    bool ended = within(milliseconds(2000), [this] {
      if (batteries) batteries->stop();
    });
    const milliseconds grace = options.stop_deadline;
    std::future<bool> http_ended = std::async(std::launch::async, [this, grace] {
      return within(grace + milliseconds(500), [this, grace] {
        if (http && !http->stop(grace)) log_warning("requests were cut off at the stop deadline");
      });
    });
    ended &= within(milliseconds(3000), [this] {
      if (attention) attention->stop();
      if (review) review->stop();
      if (watch) watch->stop();
      if (diagnoses) diagnoses->stop();
    });
    ended &= within(milliseconds(2000), [this] {
      if (ingest) ingest->stop();
      beat = {};
      warming = {};
    });
    ended &= http_ended.get();
    if (writer) {
      if (const Result<void> written = writer->stop(milliseconds(3000)); !written) {
        log_error("stopping the writer", written.error());
        ended &= writer->status().attempt_s == 0;
      }
    }
    // The robots of this daemon are committed and released.
    if (cluster) ended &= within(milliseconds(2000), [this] { cluster->leave(); });
    ended &= within(milliseconds(2000), [this] {
      if (webhooks) webhooks->stop();
    });
    return ended;
  }

  // A faulty file costs its robot, not the fleet.
  Result<void> load_robot_files(const std::string& directory) {
    TRY_ASSIGN(const ingest::RobotFiles files, ingest::read_robot_files(directory));
    for (const Error& faulty : files.faulty) log_error("robot file left out", faulty);
    for (const auto& [path, robot] : files.robots)
      TRY(ingest::load_robot(robot, path, *store, *writer, host_utime_us()));
    faulty_files = files.faulty.size();
    log_info("robot files read", {{"directory", directory},
                                  {"files", std::to_string(files.robots.size())},
                                  {"faulty", std::to_string(files.faulty.size())}});
    return {};
  }

  // Restores the last state of robots until new telemetry arrives: their charge and their contradictions.
  Result<void> recall_states() {
    TRY_ASSIGN(const auto robots, store->robots());
    for (const history::RobotRecord& robot : robots) {
      TRY_ASSIGN(const auto last, store->resume_state(robot.robot_id));
      auto contradictions = ingest::stored_contradictions(*store, robot.robot_id);
      if (!last.has_value() && contradictions.empty()) continue;
      const std::int64_t heard_us = last ? last->utime_us : contradictions.front().told_utime_us;
      auto snapshot = std::make_shared<ingest::RobotSnapshot>();
      snapshot->robot_id = robot.robot_id;
      snapshot->received_utime_us = std::min(heard_us, host_utime_us());
      snapshot->sample.utime_us = heard_us;
      const auto model = models.find(robot.robot_id);
      if (last && model != nullptr && !ingest::doubts_battery(contradictions)) {
        TRY_ASSIGN(const auto memory, store->learned(robot.robot_id, ingest::charge_topic));
        ingest::ChargeWatch charge(model->robot);
        if (memory) charge.recall(memory->body_json);
        charge.recall(last->utime_us, last->state_of_charge);
        snapshot->charge = charge.view();
        snapshot->state_of_charge = snapshot->charge.estimate.charge;
      }
      snapshot->contradictions = std::move(contradictions);
      fleet.publish(std::move(snapshot));
    }
    return {};
  }

  // Trains the forecasts from the store at the start, so that the first answers are not delayed.
  void warm_forecasts() {
    for (const auto& model : models.all()) {
      if (stopped) return;
      survive("forecasts", [&] { forecasts->of(model); });
    }
    forecasts->set_siblings_pending(false);
    for (const auto& model : models.all())
      if (!stopped && (!is_own() || is_own()(model->robot.robot_id)))
        survive("proposals", [&] { suggest_from_store(*model); });
  }

  // Missions may have been replayed into the store since the last daemon.
  void suggest_from_store(const ingest::ModelInForce& model) {
    const std::string& robot_id = model.robot.robot_id;
    const auto learned = store->learned(robot_id, ingest::RefinementWatch::topic);
    const auto marks = drift_view->marks(robot_id);
    if (!learned || !*learned || !marks) return;
    ingest::RefinementWatch refinement(model.robot, model.version);
    refinement.recall((*learned)->body_json);
    if (!marks->empty()) refinement.set_change(marks->back());
    if (std::optional<history::Proposal> better = refinement.suggestion()) {
      better->created_utime_us = host_utime_us();
      review->suggest(std::move(*better));
    }
  }

  void read_tokens() {
    gate->refresh();
    const Result<void> read = gate->check();
    if (!read && tokens_read) log_error("tokens", read.error());
    if (read && !tokens_read) log_info("the token file is read again");
    tokens_read = read.has_value();
  }

  void run_beat(const std::stop_token& stop) {
    FleetEvents fleet_events(*services, recent, events, is_own());
    do {
      survive("fleet events", [&] { fleet_events.publish(host_utime_us()); });
      survive("tokens", [&] { read_tokens(); });
    } while (sleep_for(stop, milliseconds(1000)));
  }

  const DaemonOptions options;
  Metrics metrics;
  std::size_t faulty_files = 0;
  http::EventHub events;
  ingest::ModelRegistry models;
  ingest::FleetView fleet;
  ingest::RecentValues recent;
  std::unique_ptr<ingest::Forecasts> forecasts;
  planning::CostTableCache cost_tables;
  ingest::IngestCounters counters;
  std::function<void(const std::string&, const std::string&)> warn;
  std::unique_ptr<history::Store> store;
  std::unique_ptr<server::StoreSizes> sizes;
  std::unique_ptr<server::BatteryTopics> batteries;  // null: no MQTT broker
  std::unique_ptr<server::Webhooks> webhooks;        // null: no webhooks
  std::unique_ptr<history::Writer> writer;
  std::optional<server::ClusterOptions> in_cluster;  // absent: this daemon keeps all robots
  ingest::Keeping keeping;
  std::unique_ptr<server::Cluster> cluster;
  std::atomic<bool> joined = false;  // the writer's thread may use the cluster
  std::unique_ptr<ingest::IngestService> ingest;
  std::unique_ptr<server::DriftView> drift_view;
  std::unique_ptr<server::ModelAdoption> adoption;
  std::unique_ptr<server::ProposalReview> review;
  std::unique_ptr<server::DiagnosisService> diagnoses;
  std::unique_ptr<server::GapWatch> watch;
  std::unique_ptr<api::Services> services;
  std::unique_ptr<api::AttentionList> attention;
  std::unique_ptr<http::Gate> gate;
  std::unique_ptr<api::IdempotencyKeys> idempotency;
  std::unique_ptr<http::Router> router;
  std::unique_ptr<http::HttpMetrics> http_metrics;
  std::unique_ptr<http::HttpServer> http;
  bool tokens_read = true;  // of the beat alone
  std::jthread beat, warming;
  std::atomic<bool> stopped = false;
  std::uint64_t last_receive = 0, last_account = 0, last_write = 0;
};

Application::Application(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
Application::~Application() = default;

Result<std::unique_ptr<Application>> Application::start(const DaemonOptions& options) {
  auto parts = std::make_unique<Parts>(options);
  TRY(check_exposure(options));
  TRY(parts->open_history());
  TRY(parts->start_diagnosis());
  TRY(parts->start_ingest());
  TRY(parts->start_http());
  TRY(parts->join_cluster());
  TRY(parts->start_mqtt());
  parts->beat = std::jthread([&p = *parts](const std::stop_token& stop) { p.run_beat(stop); });
  parts->warming = std::jthread([&p = *parts] { p.warm_forecasts(); });
  return std::unique_ptr<Application>(new Application(std::move(parts)));
}

std::string Application::store_name() const {
  const DaemonOptions& options = parts_->options;
  return options.store_url.empty() ? options.store_path : history::shown_url(options.store_url);
}

std::uint16_t Application::http_port() const {
  return parts_->http->port();
}

void Application::reload() {
  parts_->gate->refresh();
  if (const Result<void> reloaded = parts_->http->reload_tls(); !reloaded) {
    log_error("the previous certificate stays in use", reloaded.error());
  } else {
    log_info("reloaded");
  }
}

bool Application::alive() {
  const ingest::IngestStatus ingest = parts_->ingest->status();
  const history::WriterStatus writing = parts_->writer->status();
  constexpr milliseconds longest_silence{5000};
  const bool turning = ingest.receive_ticks != parts_->last_receive &&
                       ingest.account_ticks != parts_->last_account &&
                       // A commit that waits for the disk is not a hanging loop: a restart would not fix it.
                       (writing.ticks != parts_->last_write || writing.attempt_s > 0) &&
                       parts_->http->silence() < longest_silence;
  parts_->last_receive = ingest.receive_ticks;
  parts_->last_account = ingest.account_ticks;
  parts_->last_write = writing.ticks;
  return turning;
}

bool Application::stop() {
  return parts_->stop() && parts_->http->ended();
}

Result<std::string> store_file(const DaemonOptions& options) {
  const std::string url = store_url(options);
  if (history::is_postgres_url(url))
    return invalid("store.url",
                   "the history is in PostgreSQL: pg_dump and pg_restore copy it, joulecast store verify "
                   "reads all of it");
  return history::sqlite_path(url);
}

Result<std::string> openapi_document() {
  Metrics metrics;
  http::EventHub events;
  std::vector<http::Endpoint> table = api::endpoints(nullptr);
  TRY_ASSIGN(const auto gate, http::Gate::open({}));
  for (http::Endpoint& row : gate->session_endpoints()) table.push_back(std::move(row));
  table.push_back(http::events_endpoint(events));
  for (http::Endpoint& row : http::operations_endpoints(metrics, {})) table.push_back(std::move(row));
  return http::openapi_document(table, api::schemas(), embedded_examples());
}

}  // namespace joulecast
