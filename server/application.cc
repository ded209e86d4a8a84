#include "server/application.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <functional>
#include <future>
#include <mutex>
#include <sstream>
#include <thread>
#include <utility>
#include <vector>

#include "answers/json/autonomy_json.h"
#include "base/fault_boundary.h"
#include "base/host_clock.h"
#include "history/open_store.h"
#include "history/spool.h"
#include "history/writer.h"
#include "ingest/ingest_service.h"
#include "ingest/model_loading.h"
#include "server/api/services.h"
#include "server/daemon_metrics.h"
#include "server/diagnosis/proposal_acceptor.h"
#include "server/embedded.h"
#include "server/fleet_events.h"
#include "server/gap_metrics.h"
#include "server/http/event_hub.h"
#include "server/http/gate.h"
#include "server/http/http_metrics.h"
#include "server/http/http_server.h"
#include "server/http/openapi.h"
#include "server/http/operations.h"
#include "server/http/static_files.h"
#include "server/logging.h"
#include "server/metrics.h"
#include "server/process_metrics.h"
#include "server/robot_metrics.h"

namespace joulecast {
namespace {

using std::chrono::milliseconds;

constexpr double seconds_per_day = 86400;

milliseconds seconds(double s) {
  return milliseconds(static_cast<std::int64_t>(s * 1000));
}
std::int64_t microseconds(double s) {
  return static_cast<std::int64_t>(s * 1e6);
}

std::string store_url(const Settings& settings) {
  const std::string& url = settings.text("store.url");
  return url.empty() ? "sqlite:" + settings.text("store.path") : url;
}

// Beside the SQLite file; a file of this machine also where the history is kept elsewhere.
std::string spool_path(const Settings& settings) {
  const std::string url = store_url(settings);
  return (history::is_postgres_url(url) ? settings.text("store.path") : history::sqlite_path(url)) + ".spool";
}

// What the last daemon could not store. A spool that cannot be read is put aside: it must not stand in the
// way.
void take_in_spool(const Settings& settings, history::Store& store) {
  const std::string path = spool_path(settings);
  const Result<std::size_t> taken = history::take_in_spool(
      path, store, [](const Error& refused) { log_error("a command of the spool was refused", refused); });
  if (taken && *taken > 0) log_info("spool taken in", {{"path", path}, {"commands", std::to_string(*taken)}});
  if (taken) return;
  log_error("the spool is not taken in", taken.error());
  if (taken.error().fault == Fault::corrupt) std::rename(path.c_str(), (path + ".refused").c_str());
}

// Runs work on a thread of its own. False when it has not ended in time; then it goes on, and the process can
// only end by _exit().
bool within(milliseconds limit, std::function<void()> work) {
  auto done = std::make_shared<std::promise<void>>();
  std::future<void> ended = done->get_future();
  std::thread([done, work = std::move(work)] {
    work();
    done->set_value();
  }).detach();
  return ended.wait_for(limit) == std::future_status::ready;
}

// The entries of a list separated by commas.
std::vector<std::string> listed(const std::string& text) {
  std::vector<std::string> entries;
  std::istringstream rest(text);
  for (std::string entry; std::getline(rest, entry, ',');)
    if (!entry.empty()) entries.push_back(entry);
  return entries;
}

history::WriterOptions writer_options(const Settings& settings) {
  history::WriterOptions options;
  if (const double days = settings.number("store.retention_days"); days > 0) {
    options.retention.telemetry_max_age_us = microseconds(days * seconds_per_day);
  }
  if (const auto bytes = settings.integer("store.retention_bytes"); bytes > 0)
    options.retention.telemetry_max_bytes = bytes;
  if (const double days = settings.number("store.retention_missions_days"); days > 0)
    options.missions_max_age_us = microseconds(days * seconds_per_day);
  options.queue_bytes = static_cast<std::size_t>(settings.integer("store.queue_bytes"));
  options.spool_path = spool_path(settings);
  options.on_error = [](const Error& error) { log_error("store", error); };
  return options;
}

ingest::IngestOptions ingest_options(const Settings& settings) {
  ingest::IngestOptions options;
  options.lcm_url = settings.text("lcm.url");
  options.listen = {settings.text("lcm.bind_address"), settings.text("lcm.accept_from")};
  options.queue_messages = static_cast<std::size_t>(settings.integer("ingest.queue_messages"));
  options.energy_state_period = seconds(settings.number("energy_state.period_s"));
  options.max_unknown_robots = static_cast<std::size_t>(settings.integer("ingest.max_unknown_robots"));
  options.signatures = {settings.text("ingest.key_file"), settings.boolean("ingest.require_signed"),
                        microseconds(settings.number("ingest.signature_age_s"))};
  options.session.meter.tolerance = settings.number("meter.tolerance");
  options.session.meter.gap_bridge_s = settings.number("ingest.gap_bridge_s");
  options.session.sequence.gap_us = microseconds(settings.number("ingest.gap_bridge_s"));
  options.session.mission.explicit_silence_us =
      microseconds(settings.number("ingest.mission_idle_timeout_s"));
  options.session.implicit_missions = settings.boolean("ingest.implicit_missions");
  options.session.reorder_us = microseconds(settings.number("ingest.reorder_s"));
  options.session.sender_takeover_us = microseconds(settings.number("ingest.sender_takeover_s"));
  options.session.max_ahead_us = microseconds(settings.number("ingest.max_clock_ahead_s"));
  options.session.booked_margin_us = microseconds(settings.number("ingest.booked_time_margin_s"));
  options.session.event_rate_hz = settings.number("ingest.event_rate_hz");
  return options;
}

server::AdoptionOptions adoption_options(const Settings& settings) {
  server::AdoptionOptions options;
  options.max_missions = static_cast<std::size_t>(settings.integer("adoption.max_missions"));
  options.max_samples = static_cast<std::size_t>(settings.integer("adoption.max_samples"));
  options.meter.tolerance = settings.number("meter.tolerance");
  options.meter.gap_bridge_s = settings.number("ingest.gap_bridge_s");
  return options;
}

server::DiagnosisOptions diagnosis_options(const Settings& settings) {
  server::DiagnosisOptions options;
  options.queue = static_cast<std::size_t>(settings.integer("diagnosis.queue"));
  options.max_missions = static_cast<std::size_t>(settings.integer("diagnosis.max_missions"));
  options.max_samples = static_cast<std::size_t>(settings.integer("diagnosis.max_samples"));
  options.controls = static_cast<std::size_t>(settings.integer("diagnosis.controls"));
  options.threads = static_cast<std::size_t>(settings.integer("diagnosis.threads"));
  options.max_memory_bytes = static_cast<std::uint64_t>(settings.integer("diagnosis.max_memory_bytes"));
  options.deadline = seconds(settings.number("diagnosis.deadline_s"));
  return options;
}

server::DriftOptions drift_options(const Settings& settings) {
  server::DriftOptions options;
  options.settings.least_change = settings.number("watch.least_change");
  return options;
}

server::WatchOptions watch_options(const Settings& settings) {
  server::WatchOptions options;
  options.period_s = settings.number("watch.period_s");
  options.diagnose = settings.boolean("watch.diagnose");
  for (std::string& id : listed(settings.text("watch.robots"))) options.robots.insert(std::move(id));
  return options;
}

http::ServerOptions http_options(const Settings& settings) {
  http::ServerOptions options;
  options.address = settings.text("http.address");
  options.port = static_cast<std::uint16_t>(settings.integer("http.port"));
  options.allowed_hosts = listed(settings.text("http.allowed_hosts"));
  options.tls_certificate = settings.text("http.tls_certificate");
  options.tls_key = settings.text("http.tls_key");
  options.worker_threads = static_cast<unsigned>(settings.integer("http.worker_threads"));
  options.compute_threads = static_cast<unsigned>(settings.integer("http.compute_threads"));
  options.worker_queue = static_cast<std::size_t>(settings.integer("http.worker_queue"));
  options.client_requests = static_cast<std::size_t>(settings.integer("http.client_requests"));
  options.max_connections = static_cast<std::size_t>(settings.integer("http.max_connections"));
  options.client_connections = static_cast<std::size_t>(settings.integer("http.client_connections"));
  options.max_header_bytes = static_cast<std::uint32_t>(settings.integer("http.max_header_bytes"));
  options.max_body_bytes = static_cast<std::uint64_t>(settings.integer("http.max_body_bytes"));
  options.max_bodies_bytes = static_cast<std::uint64_t>(settings.integer("http.max_bodies_bytes"));
  options.read_timeout = seconds(settings.number("http.read_timeout_s"));
  options.write_timeout = seconds(settings.number("http.write_timeout_s"));
  options.idle_timeout = seconds(settings.number("http.idle_timeout_s"));
  options.request_deadline = seconds(settings.number("http.request_deadline_s"));
  return options;
}

http::EventHub::Options event_options(const Settings& settings) {
  http::EventHub::Options options;
  options.queue_bytes = static_cast<std::size_t>(settings.integer("http.event_queue_bytes"));
  options.max_subscribers = static_cast<std::size_t>(settings.integer("http.event_streams"));
  return options;
}

// Without tokens only this machine is served, unless the settings say otherwise.
Result<void> check_exposure(const Settings& settings) {
  const std::string& address = settings.text("http.address");
  if (http::is_loopback(address)) return {};
  if (!settings.text("auth.token_file").empty()) {
    if (settings.text("http.tls_certificate").empty())
      log_warning(
          "tokens travel unencrypted to this address: set http.tls_certificate, or listen on 127.0.0.1 "
          "behind a proxy that speaks TLS",
          {{"address", address}});
    return {};
  }
  if (settings.boolean("http.insecure")) {
    log_warning("everybody who reaches this address may read and change everything (http.insecure)",
                {{"address", address}});
    return {};
  }
  return invalid("http.address",
                 "is " + address +
                     ", which others reach, and no auth.token_file says who may do what: make one with "
                     "joulecast token create, listen on 127.0.0.1, or set http.insecure");
}

// Who changed something or was refused, into the store's audit.
std::function<Result<void>(http::AccessEvent)> audit_into(history::Writer& writer) {
  return [&writer](http::AccessEvent event) {
    return writer.offer(history::AppendAudit{{0, host_utime_us(), std::move(event.actor),
                                              std::move(event.address), std::move(event.request_id),
                                              std::move(event.action), std::move(event.detail_json), ""}});
  };
}

// Every documented endpoint and the page.
Result<std::vector<http::Endpoint>> endpoint_table(api::Services& services, Metrics& metrics,
                                                   http::EventHub& events, http::Gate& gate,
                                                   std::vector<http::ReadinessCheck> checks,
                                                   const std::string& web_directory) {
  std::vector<http::Endpoint> table;
  for (http::Endpoint& row : api::endpoints(services)) table.push_back(gate.audited(std::move(row)));
  for (http::Endpoint& row : gate.session_endpoints()) table.push_back(std::move(row));
  table.push_back(http::events_endpoint(events));
  for (http::Endpoint& row : http::operations_endpoints(metrics, std::move(checks)))
    table.push_back(std::move(row));
  Result<std::vector<http::Endpoint>> documented = http::with_openapi(std::move(table), embedded_schemas());
  if (!documented) return documented;
  Result<std::vector<http::Endpoint>> page =
      web_directory.empty() ? Result<std::vector<http::Endpoint>>(http::asset_endpoints(embedded_web()))
                            : http::asset_endpoints_from(web_directory);
  if (!page) return page;
  for (http::Endpoint& row : *page) documented->push_back(std::move(row));
  return documented;
}

}  // namespace

// In the order of construction; destroyed in reverse.
struct Application::Parts {
  explicit Parts(const Settings& s)
      : settings(s), events(event_options(s)), warn([](const std::string& robot, const std::string& text) {
          log_warning(text, {{"robot_id", robot}});
        }) {}

  ~Parts() {
    (void)stop();
    observe_faults({});
  }

  // What a thread survived becomes a log line, a count and an entry of the audit log.
  void tell_of_faults() {
    const Counter survived =
        metrics.counter("joulecast_internal_faults_total",
                        "Exceptions that a thread survived: each cost one message, one commit or one job");
    observe_faults([survived, &writer = *writer](std::string_view part, std::string_view why) {
      survived.add(1);
      log_error("internal fault", Error{Fault::internal, std::string(part), std::string(why)});
      JsonWriter detail;
      detail.begin_object().field("part", part).field("why", why).end_object();
      (void)writer.offer(history::AppendEvent{{0, host_utime_us(), "", "internal_fault", detail.take()}});
    });
  }

  // Whatever does not end is left behind, so that the store is always brought to its end.
  bool stop() {
    if (stopped.exchange(true)) return true;
    const milliseconds patience = seconds(settings.number("http.stop_deadline_s"));
    std::future<bool> http_ended = std::async(std::launch::async, [this, patience] {
      return within(patience + milliseconds(500), [this, patience] {
        if (http && !http->stop(patience)) log_warning("requests were cut off at the stop deadline");
      });
    });
    bool ended = within(milliseconds(3000), [this] {
      if (acceptor) acceptor->stop();
      if (watch) watch->stop();
      if (diagnoses) diagnoses->stop();
    });
    ended &= within(milliseconds(2000), [this] {
      if (ingest) ingest->stop();
      {
        const std::lock_guard lock(beat_mutex);
        beating = false;
      }
      beat_wake.notify_all();
      if (beat.joinable()) beat.join();
      if (warming.joinable()) warming.join();
    });
    ended &= http_ended.get();
    if (writer) {
      if (const Result<void> written = writer->stop(milliseconds(3000)); !written) {
        log_error("stopping the writer", written.error());
        ended &= writer->status().attempt_s == 0;
      }
    }
    return ended;
  }

  void report_drift(const std::string& robot_id, const forecast::Drift& drift,
                    const std::function<void(history::Command)>& post) {
    JsonWriter json;
    answers::write_drift(json, drift);
    std::string detail = json.take();
    log_warning("consumption has changed", {{"robot_id", robot_id}, {"drift", detail}});
    events.publish("drift", detail, robot_id);
    post(history::AppendEvent{{0, host_utime_us(), robot_id, "consumption_drift", std::move(detail)}});
  }

  // A faulty file costs its robot, not the fleet.
  Result<void> load_robot_files(const std::string& directory) {
    const Result<ingest::RobotFiles> files = ingest::read_robot_files(directory);
    if (!files) return tl::unexpected(files.error());
    for (const Error& faulty : files->faulty) log_error("robot file left out", faulty);
    for (const auto& [path, robot] : files->robots) {
      if (Result<void> loaded = ingest::load_robot(robot, path, *store, *writer, host_utime_us()); !loaded)
        return loaded;
    }
    faulty_files.set(static_cast<double>(files->faulty.size()));
    log_info("robot files read", {{"directory", directory},
                                  {"files", std::to_string(files->robots.size())},
                                  {"faulty", std::to_string(files->faulty.size())}});
    return {};
  }

  // What is known of robots until they speak again: their charge when they were last heard.
  Result<void> recall_states() {
    const auto robots = store->robots();
    if (!robots) return tl::unexpected(robots.error());
    for (const history::RobotRecord& robot : *robots) {
      const auto last = store->resume_state(robot.robot_id);
      if (!last) return tl::unexpected(last.error());
      if (!last->has_value()) continue;
      auto snapshot = std::make_shared<ingest::RobotSnapshot>();
      snapshot->robot_id = robot.robot_id;
      snapshot->received_utime_us = std::min((*last)->utime_us, host_utime_us());
      snapshot->sample.utime_us = (*last)->utime_us;
      snapshot->state_of_charge = (*last)->state_of_charge;
      snapshot->charge.estimate.charge = (*last)->state_of_charge;
      fleet.publish(std::move(snapshot));
    }
    return {};
  }

  // Learns from what the store kept, so that the first answers need not wait for it.
  void warm_forecasts() {
    for (const auto& model : models.all()) {
      if (stopped) return;
      survive("forecasts", [&] { forecasts->of(model); });
    }
  }

  void run_beat() {
    server::FleetEvents fleet_events(fleet, models, *forecasts, *store, events);
    std::unique_lock lock(beat_mutex);
    while (beating) {
      lock.unlock();
      survive("fleet events", [&] { fleet_events.publish(host_utime_us()); });
      survive("tokens", [&] { gate->refresh(); });
      lock.lock();
      beat_wake.wait_for(lock, milliseconds(1000), [&] { return !beating; });
    }
  }

  const Settings settings;
  Metrics metrics;
  const Gauge faulty_files =
      metrics.gauge("joulecast_robot_files_faulty", "Robot files left out at the start for being faulty");
  http::EventHub events;
  ingest::ModelRegistry models;
  ingest::FleetView fleet;
  std::unique_ptr<ingest::Forecasts> forecasts;
  planning::CostTableCache cost_tables;
  ingest::IngestCounters counters;
  std::function<void(const std::string&, const std::string&)> warn;
  std::unique_ptr<history::Store> store;
  std::unique_ptr<history::Writer> writer;
  std::unique_ptr<ingest::IngestService> ingest;
  std::unique_ptr<server::DriftView> drift_view;
  std::unique_ptr<server::ModelAdoption> adoption;
  std::unique_ptr<server::ProposalAcceptor> acceptor;  // null: a person adopts
  std::unique_ptr<server::DiagnosisService> diagnoses;
  std::unique_ptr<server::GapWatch> watch;
  std::unique_ptr<api::Services> services;
  std::unique_ptr<http::Gate> gate;
  std::unique_ptr<http::Router> router;
  std::unique_ptr<http::HttpMetrics> http_metrics;
  std::unique_ptr<http::HttpServer> http;
  std::mutex beat_mutex;
  std::condition_variable beat_wake;
  bool beating = true;
  std::thread beat, warming;
  std::atomic<bool> stopped = false;
  std::uint64_t last_receive = 0, last_account = 0, last_write = 0;
};

Application::Application(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
Application::~Application() = default;

Result<std::unique_ptr<Application>> Application::start(const Settings& settings) {
  auto parts = std::make_unique<Parts>(settings);
  Parts& p = *parts;

  if (const Result<void> safe = check_exposure(settings); !safe) return tl::unexpected(safe.error());
  const bool by_path = settings.text("store.url").empty();
  Result<std::unique_ptr<history::Store>> store = history::open_store(store_url(settings));
  if (!store)
    return fail(store.error().fault, by_path ? "store.path" : "store.url", std::move(store.error().message));
  p.store = std::move(*store);
  take_in_spool(settings, *p.store);
  p.writer = std::make_unique<history::Writer>(*p.store, writer_options(settings));
  p.tell_of_faults();

  if (const std::string& directory = settings.text("robots.directory"); !directory.empty()) {
    if (Result<void> loaded = p.load_robot_files(directory); !loaded) return tl::unexpected(loaded.error());
  }
  if (Result<void> models = ingest::load_stored_models(*p.store, p.models); !models)
    return tl::unexpected(std::move(models.error()));

  if (Result<void> recalled = p.recall_states(); !recalled)
    return tl::unexpected(std::move(recalled.error()));

  p.forecasts = std::make_unique<ingest::Forecasts>(*p.store);
  history::Writer& writer = *p.writer;
  const auto post = [&writer, warn = p.warn](history::Command command) {
    if (const Result<void> posted = writer.offer(std::move(command)); !posted)
      warn("", describe(posted.error()));
  };
  ingest::SessionOutputs outputs{*p.store, post, p.fleet, p.counters, p.warn};
  outputs.mission_ended = [&p, post](const std::shared_ptr<const ingest::ModelInForce>& model,
                                     forecast::PastMission mission) {
    // A mission that ran into a new version is learnt against the one in force now.
    const auto in_force = p.models.find(model->robot.robot_id);
    ingest::Forecasts::Learnt learnt =
        p.forecasts->learn(in_force != nullptr ? in_force : model, std::move(mission));
    post(history::PutLearned{std::move(learnt.document)});
    if (learnt.drift) p.report_drift(model->robot.robot_id, *learnt.drift, post);
  };
  p.ingest =
      std::make_unique<ingest::IngestService>(ingest_options(settings), p.models, *p.forecasts, outputs);
  if (Result<void> started = p.ingest->start(); !started) return tl::unexpected(std::move(started.error()));

  p.drift_view = std::make_unique<server::DriftView>(*p.store, p.models, drift_options(settings));
  p.adoption = std::make_unique<server::ModelAdoption>(*p.store, *p.writer, p.models, *p.drift_view,
                                                       host_utime_us, adoption_options(settings));
  if (settings.boolean("adoption.automatic")) {
    p.acceptor = std::make_unique<server::ProposalAcceptor>(*p.store, *p.adoption, p.warn);
    p.acceptor->start(milliseconds(10'000));
  }
  const auto warn_of = [](const Error& error) { log_error("diagnosis", error); };
  p.diagnoses = std::make_unique<server::DiagnosisService>(
      *p.store, *p.writer, p.models, *p.drift_view, host_utime_us, diagnosis_options(settings), warn_of,
      [&p](const history::DiagnosisRecord& diagnosis) { p.watch->on_diagnosis(diagnosis); });
  p.watch = std::make_unique<server::GapWatch>(*p.store, *p.writer, p.models, *p.drift_view, *p.diagnoses,
                                               host_utime_us, watch_options(settings), warn_of);
  if (Result<void> started = p.diagnoses->start(); !started)
    return tl::unexpected(std::move(started.error()));
  p.watch->start();
  p.services = std::make_unique<api::Services>(api::Services{*p.store, *p.writer, p.models, p.fleet,
                                                             *p.forecasts, p.cost_tables, *p.drift_view,
                                                             *p.adoption, *p.diagnoses, host_utime_us});
  Result<std::unique_ptr<http::Gate>> gate =
      http::Gate::open({.token_file = settings.text("auth.token_file"),
                        .secure = !settings.text("http.tls_certificate").empty(),
                        .now_utime_us = host_utime_us,
                        .audit = audit_into(*p.writer)});
  if (!gate) return tl::unexpected(std::move(gate.error()));
  p.gate = std::move(*gate);
  std::vector<http::ReadinessCheck> checks;
  checks.push_back({"ingest", [&p]() -> Result<void> {
                      const ingest::IngestStatus status = p.ingest->status();
                      if (!status.receiving)
                        return fail(Fault::unavailable, "ingest",
                                    "LCM is not being received: " + status.error);
                      return {};
                    }});
  checks.push_back({"store", [&p]() -> Result<void> {
                      const history::WriterStatus status = p.writer->status();
                      if (!status.healthy) return fail(Fault::unavailable, "store", status.error);
                      return {};
                    }});
  if (!settings.text("auth.token_file").empty())
    checks.push_back({"tokens", [&p] { return p.gate->check(); }});
  Result<std::vector<http::Endpoint>> table = endpoint_table(
      *p.services, p.metrics, p.events, *p.gate, std::move(checks), settings.text("http.web_directory"));
  if (!table) return tl::unexpected(std::move(table.error()));
  const auto log_fault = [](const http::Endpoint& endpoint, const http::Request& request,
                            const Error& error) {
    log_error("request failed",
              {{"operation", endpoint.operation_id}, {"request_id", request.id}, {"cause", describe(error)}});
  };
  p.router = std::make_unique<http::Router>(std::move(*table), log_fault,
                                            [&p](const http::Endpoint& endpoint, http::Request& request) {
                                              return p.gate->refuse(endpoint, request);
                                            });
  p.http_metrics = std::make_unique<http::HttpMetrics>(p.metrics);
  server::export_metrics(p.metrics, p.counters, *p.ingest, p.fleet, *p.writer, *p.store, p.events,
                         host_utime_us);
  server::export_gap_metrics(p.metrics, *p.diagnoses, *p.watch, *p.adoption);
  server::export_process_metrics(p.metrics);
  server::export_robot_metrics(p.metrics, p.fleet, *p.watch, host_utime_us,
                               static_cast<std::size_t>(settings.integer("metrics.robots")));
  Result<std::unique_ptr<http::HttpServer>> http =
      http::HttpServer::start(http_options(settings), *p.router, p.http_metrics.get());
  if (!http) return tl::unexpected(std::move(http.error()));
  p.http = std::move(*http);
  p.beat = std::thread([&p] { p.run_beat(); });
  p.warming = std::thread([&p] { p.warm_forecasts(); });
  return std::unique_ptr<Application>(new Application(std::move(parts)));
}

std::string Application::store_name() const {
  const std::string& url = parts_->settings.text("store.url");
  return url.empty() ? parts_->settings.text("store.path") : history::shown_url(url);
}

std::uint16_t Application::http_port() const {
  return parts_->http->port();
}

void Application::reload() {
  parts_->gate->refresh();
  if (const Result<void> reloaded = parts_->http->reload_tls(); !reloaded) {
    log_error("the certificate from before stays", reloaded.error());
  } else {
    log_info("reloaded");
  }
}

bool Application::alive() {
  const ingest::IngestStatus ingest = parts_->ingest->status();
  const history::WriterStatus writing = parts_->writer->status();
  constexpr milliseconds longest_silence{5000};
  const bool turning =
      ingest.receive_ticks != parts_->last_receive && ingest.account_ticks != parts_->last_account &&
      // A commit that waits for the disk is not a loop that hangs: a restart would not mend it.
      (writing.ticks != parts_->last_write || writing.attempt_s > 0) &&
      parts_->http->silence() < longest_silence;
  parts_->last_receive = ingest.receive_ticks;
  parts_->last_account = ingest.account_ticks;
  parts_->last_write = writing.ticks;
  return turning;
}

std::vector<Error> faults_of_access(const Settings& settings) {
  std::vector<Error> faults;
  if (const Result<void> safe = check_exposure(settings); !safe) faults.push_back(safe.error());
  if (const Result<std::unique_ptr<http::Gate>> gate =
          http::Gate::open({.token_file = settings.text("auth.token_file")});
      !gate)
    faults.push_back(gate.error());
  return faults;
}

std::vector<Error> faulty_robot_files(const Settings& settings) {
  const std::string& directory = settings.text("robots.directory");
  if (directory.empty()) return {};
  const Result<ingest::RobotFiles> files = ingest::read_robot_files(directory);
  return files ? files->faulty : std::vector<Error>{files.error()};
}

bool Application::stop() {
  return parts_->stop() && parts_->http->ended();
}

Result<std::string> store_file(const Settings& settings) {
  const std::string url = store_url(settings);
  if (history::is_postgres_url(url))
    return invalid("store.url",
                   "the history is in PostgreSQL: pg_dump and pg_restore copy it, joulecast store verify "
                   "reads all of it");
  return history::sqlite_path(url);
}

Result<std::string> openapi_document() {
  Metrics metrics;
  http::EventHub events;
  std::vector<http::Endpoint> table = api::described_endpoints();
  for (http::Endpoint& row : http::described_session_endpoints()) table.push_back(std::move(row));
  table.push_back(http::events_endpoint(events));
  for (http::Endpoint& row : http::operations_endpoints(metrics, {})) table.push_back(std::move(row));
  return http::openapi_document(table, embedded_schemas());
}

}  // namespace joulecast
