#include "server/api/attention.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/fault_boundary.h"
#include "base/json_fields.h"
#include "base/json_writer.h"
#include "base/try.h"
#include "base/utc_time.h"
#include "server/api/change.h"
#include "server/api/robot_json.h"
#include "server/api/services.h"

namespace joulecast::api {
namespace {

using http::Method;
using http::Request;
using http::Response;

constexpr const char* topic = "attention";
constexpr std::size_t most_note = 1024;  // bytes
// Two readings for each one of the page, which renews the list every 10 s.
constexpr std::chrono::seconds findings_period{5};

// A kind of condition and its events in the log, empty: none of its own.
struct AttentionKind {
  std::string_view name, begins = {}, ends = {};
};
constexpr AttentionKind kinds[] = {{"contradicted", "", "contradiction_ended"},
                                   {"silent", "robot_silent", "robot_back"},
                                   {"no_robot_file"},
                                   {"charge_low", "charge_low", "charge_restored"},
                                   {"drift"},
                                   {"stands_out"},
                                   {"gap_diagnosed"},
                                   {"proposal"},
                                   {"store"},
                                   {"cluster"}};

std::string_view name_of(Severity severity) {
  return severity_names[static_cast<std::size_t>(severity)];
}

std::string text_of(const nlohmann::json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

void order(std::vector<AttentionReason>& reasons) {
  std::ranges::stable_sort(reasons, {}, [](const AttentionReason& r) {
    return std::pair(r.acknowledged.has_value(), r.severity);
  });
}

void add_telemetry(std::vector<AttentionReason>& reasons, const ingest::RobotSnapshot& s,
                   const ingest::ModelInForce* model, std::int64_t now_utime_us) {
  for (const ingest::Contradiction& c : s.contradictions) {
    std::string action = c.channel.empty() ? "Correct the robot's telemetry."
                                           : "Correct " + c.channel + " in the robot's telemetry.";
    if (c.untrue) action.append(" Until then its missions are not used for training.");
    reasons.push_back({"contradicted", Severity::fault, c.told_utime_us, c.says, std::move(action),
                       c.id + ' ' + c.channel});
  }
  const bool live = is_live(s, now_utime_us);
  if (!live && s.received_utime_us > 0 && !s.mission_id.empty())
    reasons.push_back({"silent", Severity::fault, s.received_utime_us,
                       fmt::format("No telemetry since {} during mission {}.",
                                   utc_text(s.received_utime_us).substr(0, 19), s.mission_id),
                       "Check the robot's power and its network."});
  if (live && model == nullptr)
    reasons.push_back({"no_robot_file",
                       Severity::warning,
                       {},
                       "Telemetry of a robot without a robot file is not recorded.",
                       "Add its robot file: PUT /v1/robots/" + s.robot_id + "."});
  if (live && model != nullptr && !battery::at_charger(s.charge.phase) &&
      s.state_of_charge < model->robot.battery.reserve_fraction)  // false for NaN
    reasons.push_back({"charge_low",
                       Severity::warning,
                       {},
                       fmt::format("Charge {:.0f} %, below the reserve of {:.0f} %.", 100 * s.state_of_charge,
                                   100 * model->robot.battery.reserve_fraction),
                       "Send it to a charger."});
}

std::string_view words_of(drift::Quantity quantity) {
  return quantity == drift::Quantity::mass ? "Mass by its accelerations"
                                           : "Internal resistance of its battery";
}

void add_watch(std::vector<AttentionReason>& reasons, const server::WatchFinding& found,
               std::int64_t version_in_force) {
  const auto change = [](double share) {
    return fmt::format("{:.1f} % {} energy", 100 * std::abs(share), share < 0 ? "less" : "more");
  };
  if (found.change && found.change->model_version == version_in_force) {
    const drift::Mark& mark = *found.change;
    std::string what = "Uses " + change(mark.change()) + " than";
    if (mark.quantity != drift::Quantity::energy)
      what = fmt::format("{} {:+.1f} % against", words_of(mark.quantity), 100 * mark.change());
    reasons.push_back({"drift", Severity::warning, mark.utime_us,
                       fmt::format("{} before {}.", what, utc_text(mark.utime_us).substr(0, 10)),
                       "Start a diagnosis, or compare it with robots of its kind.",
                       std::to_string(mark.utime_us)});
  }
  if (found.among_kind && found.among_kind->stands_out)
    reasons.push_back({"stands_out",
                       Severity::notice,
                       {},
                       fmt::format("Uses {} than its model predicts, unlike the other robots of its kind.",
                                   change(found.among_kind->ratio - 1)),
                       "Check its payload, tyres and floor, or start a diagnosis."});
}

// The newest diagnosis of each robot, where it names effects and no model was adopted since.
Result<void> add_diagnoses(std::map<std::string, std::vector<AttentionReason>>& reasons,
                           const Services& services) {
  const auto found =
      services.store.diagnoses({}, std::numeric_limits<std::int64_t>::max(), history::max_page_size);
  if (!found) return tl::unexpected(found.error());
  std::set<std::string> seen;
  for (const history::DiagnosisRecord& d : *found) {
    if (d.state != history::DiagnosisState::done || !seen.insert(d.robot_id).second) continue;
    const auto model = services.models.find(d.robot_id);
    const auto summary = nlohmann::json::parse(d.summary_json, nullptr, false);
    if (model == nullptr || d.model_version != model->version || !summary.is_object() ||
        summary.value("verdict", "") != "effects")
      continue;
    std::string names;
    for (const auto& effect : summary["effects"]) {
      names += (names.empty() ? "" : ", ") + effect.value("id", std::string());
      for (const auto& other : effect.value("alternatives", std::vector<std::string>{}))
        names += " or " + other;
    }
    std::ranges::replace(names, '_', ' ');
    reasons[d.robot_id].push_back(
        {"gap_diagnosed", Severity::warning, d.finished_utime_us,
         fmt::format("Diagnosis {} found {}.", d.id, names),
         "Check the cause on the robot; adopt the corrected model if it is confirmed.",
         std::to_string(d.id)});
  }
  return {};
}

Result<void> add_proposals(std::map<std::string, std::vector<AttentionReason>>& reasons,
                           const Services& services) {
  TRY_ASSIGN(const auto found,
             services.store.proposals({}, std::numeric_limits<std::int64_t>::max(), history::max_page_size));
  for (const history::Proposal& p : found)
    if (const auto model = services.models.find(p.robot_id);
        model != nullptr && p.state == history::ProposalState::open &&
        p.base_version.value_or(model->version) == model->version) {
      // One remedy at a time: it predicts better than the diagnosed model.
      for (AttentionReason& reason : reasons[p.robot_id])
        if (reason.kind == "gap_diagnosed") reason.action = "Check the cause on the robot.";
      reasons[p.robot_id].push_back({"proposal", Severity::notice, p.created_utime_us,
                                     fmt::format("A better model is proposed: {}.", p.note),
                                     "Review its back-test, then adopt or dismiss it.",
                                     std::to_string(p.id)});
    }
  return {};
}

void add_service(std::vector<AttentionReason>& reasons, const Services& services) {
  if (const history::WriterStatus status = services.writer.status(); !status.healthy)
    reasons.push_back({"store",
                       Severity::fault,
                       {},
                       "The store does not commit: " + status.error + ".",
                       "Check the disk or the database; the daemon retries automatically."});
  if (services.cluster == nullptr) return;
  if (const server::ClusterStatus status = services.cluster->status(); !status.error.empty())
    reasons.push_back({"cluster",
                       Severity::fault,
                       {},
                       "The cluster's database was not reached: " + status.error + ".",
                       "Check the database and the network between them."});
}

// The stored form of a robot's reasons.
std::string reasons_json(const std::vector<AttentionReason>& reasons) {
  nlohmann::json list = nlohmann::json::array();
  for (const AttentionReason& r : reasons) {
    nlohmann::json one{{"kind", r.kind},
                       {"subject", r.subject},
                       {"severity", static_cast<int>(r.severity)},
                       {"message", r.message},
                       {"action", r.action}};
    if (r.since_utime_us) one["since_utime_us"] = *r.since_utime_us;
    if (r.acknowledged)
      one["acknowledged"] = {
          {"utime_us", r.acknowledged->utime_us}, {"by", r.acknowledged->by}, {"note", r.acknowledged->note}};
    list.push_back(std::move(one));
  }
  return text_of({{"reasons", std::move(list)}});
}

// Throws nlohmann::json::exception for another form.
std::vector<AttentionReason> reasons_from(const std::string& body_json) {
  std::vector<AttentionReason> reasons;
  const auto body = nlohmann::json::parse(body_json);
  for (const auto& one : body.at("reasons")) {
    AttentionReason r{one.at("kind"),
                      static_cast<Severity>(std::clamp(one.at("severity").get<int>(), 0, 2)),
                      {},
                      one.at("message"),
                      one.at("action"),
                      one.at("subject")};
    if (one.contains("since_utime_us")) r.since_utime_us = one["since_utime_us"];
    if (one.contains("acknowledged")) {
      const auto& by = one["acknowledged"];
      r.acknowledged = Acknowledgement{by.at("utime_us"), by.at("by"), by.at("note")};
    }
    reasons.push_back(std::move(r));
  }
  return reasons;
}

void write_entry(JsonWriter& json, const AttentionEntry& entry) {
  json.begin_object().key("robot_id");
  entry.robot_id.empty() ? json.null() : json.value(entry.robot_id);
  json.field("severity", name_of(entry.reasons.front().severity));
  json.field("acknowledged", entry.reasons.front().acknowledged.has_value());
  json.key("reasons").begin_array();
  for (const AttentionReason& reason : entry.reasons) {
    json.begin_object().field("kind", reason.kind).field("severity", name_of(reason.severity));
    json.time("since", reason.since_utime_us);
    json.field("message", reason.message).field("action", reason.action).key("acknowledged");
    if (const auto& by = reason.acknowledged) {
      json.begin_object().time("", by->utime_us).key("by");
      by->by.empty() ? json.null() : json.value(by->by);
      json.field("note", by->note).end_object();
    } else {
      json.null();
    }
    json.end_object();
  }
  json.end_array().end_object();
}

Result<Response> get_attention(const Services& services, const Request&) {
  std::array<std::int64_t, std::size(severity_names)> counts{};
  JsonWriter json;
  json.begin_object().key("attention").begin_array();
  for (const AttentionEntry& entry : services.attention->entries()) {
    const AttentionReason& worst = entry.reasons.front();
    if (!worst.acknowledged) ++counts[static_cast<std::size_t>(worst.severity)];
    write_entry(json, entry);
  }
  json.end_array().key("counts").begin_object();
  for (std::size_t k = 0; k < counts.size(); ++k) json.field(severity_names[k], counts[k]);
  json.end_object().end_object();
  return http::json_response(json.take());
}

Result<Response> acknowledge(const Services& services, const Request& request) {
  const std::string& robot_id = request.param("id");
  if (services.models.find(robot_id) == nullptr && services.fleet.find(robot_id) == nullptr)
    return tl::unexpected(ingest::unknown_robot("id", robot_id));
  Fields fields(*request.json);
  const std::string kind = fields.choice("kind", attention_kinds());
  const std::string note = fields.text("note", most_note);
  TRY(fields.finish());
  RequestChange request_change(services, request);
  const history::Outcome done = services.attention->acknowledge(
      robot_id, kind, {services.now_utime_us(), request.actor, note},
      [&](const AttentionEntry& entry, history::Learned learned) {
        history::Change change = request_change.answered_by([entry](std::int64_t) {
          JsonWriter json;
          write_entry(json, entry);
          return http::json_response(json.take());
        });
        change.command = history::PutLearned{std::move(learned)};
        return services.writer.execute(std::move(change));
      });
  return request_change.result(done);
}

}  // namespace

std::vector<std::string_view> attention_kinds() {
  std::vector<std::string_view> names;
  for (const AttentionKind& kind : kinds) names.push_back(kind.name);
  return names;
}

AttentionList::AttentionList(const Services& services, std::function<bool(const std::string&)> is_own,
                             std::function<void(const Error&)> on_error)
    : services_(services), is_own_(std::move(is_own)), on_error_(std::move(on_error)) {}

AttentionList::~AttentionList() {
  stop();
}

void AttentionList::start() {
  running_ = true;
  thread_ = std::thread([this] {
    std::unique_lock lock(mutex_);
    while (running_) {
      lock.unlock();
      survive("attention", [this] { look(); });
      lock.lock();
      wake_.wait_for(lock, std::chrono::seconds(1), [this] { return !running_; });
    }
  });
}

void AttentionList::stop() {
  {
    const std::lock_guard lock(mutex_);
    running_ = false;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
}

std::vector<AttentionEntry> AttentionList::entries() const {
  std::vector<AttentionEntry> entries;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [robot_id, reasons] : shown_)
      if (!reasons.empty()) entries.push_back({robot_id, reasons});
  }
  std::ranges::stable_sort(entries, {}, [](const AttentionEntry& e) {
    return std::pair(e.reasons.front().acknowledged.has_value(), e.reasons.front().severity);
  });
  return entries;
}

history::Outcome AttentionList::acknowledge(const std::string& robot_id, const std::string& kind,
                                            const Acknowledgement& by, const Commit& commit) {
  const std::lock_guard changing(changing_);
  AttentionEntry entry{robot_id, {}};
  {
    const std::lock_guard lock(mutex_);
    if (const auto found = shown_.find(robot_id); found != shown_.end()) entry.reasons = found->second;
  }
  bool any = false;
  for (AttentionReason& reason : entry.reasons) {
    if (reason.kind != kind) continue;
    reason.acknowledged = by;
    any = true;
  }
  if (!any) return fail(Fault::not_found, "kind", "robot " + robot_id + " has no reason of kind " + kind);
  order(entry.reasons);
  const history::Outcome done = commit(entry, {robot_id, topic, by.utime_us, reasons_json(entry.reasons)});
  if (!done) return done;
  const std::lock_guard lock(mutex_);
  shown_[robot_id] = std::move(entry.reasons);
  return done;
}

std::vector<AttentionReason> AttentionList::remembered(const std::string& robot_id) const {
  std::vector<AttentionReason> reasons;
  if (robot_id.empty()) return reasons;
  const auto stored = services_.store.learned(robot_id, topic);
  if (!stored) on_error_(stored.error());
  if (stored && *stored) survive("attention", [&] { reasons = reasons_from((*stored)->body_json); });
  return reasons;
}

// A reason that is not found stays until it is known to have ended.
bool AttentionList::has_ended(const std::string& robot_id, const AttentionReason& reason) const {
  if (robot_id.empty() || reason.kind == "contradicted") return true;
  if (reason.kind == "drift" || reason.kind == "stands_out")
    return services_.watch.findings().contains(robot_id);
  if (reason.kind == "gap_diagnosed" || reason.kind == "proposal") return read_at_.has_value();
  const auto robot = services_.fleet.find(robot_id);
  if (robot == nullptr || !is_live(*robot, services_.now_utime_us())) return false;
  if (reason.kind != "charge_low" || battery::at_charger(robot->charge.phase)) return true;
  // By more than the charge's standard deviation, so that its noise does not end the condition.
  const auto model = services_.models.find(robot_id);
  return model == nullptr ||
         robot->state_of_charge - robot->charge.estimate.sd > model->robot.battery.reserve_fraction;
}

void AttentionList::record(const std::string& robot_id, const AttentionReason& reason, bool begins) {
  const auto* kind = std::ranges::find(kinds, std::string_view(reason.kind), &AttentionKind::name);
  if (kind == std::end(kinds)) return;
  const std::string_view event = begins ? kind->begins : kind->ends;
  if (event.empty()) return;
  nlohmann::json detail{{"message", reason.message}};
  if (reason.since_utime_us) detail["since_utime_us"] = *reason.since_utime_us;
  if (const auto posted = services_.writer.offer(
          history::AppendEvent{{0, services_.now_utime_us(), robot_id, std::string(event), text_of(detail)}});
      !posted)
    on_error_(posted.error());
}

AttentionList::Reasons AttentionList::found() {
  Reasons found = findings_;
  const std::int64_t now_utime_us = services_.now_utime_us();
  for (const auto& snapshot : services_.fleet.all())
    add_telemetry(found[snapshot->robot_id], *snapshot, services_.models.find(snapshot->robot_id).get(),
                  now_utime_us);
  for (const auto& [robot_id, finding] : services_.watch.findings())
    if (const auto model = services_.models.find(robot_id))
      add_watch(found[robot_id], finding, model->version);
  add_service(found[""], services_);
  return found;
}

// Gives the reasons found now the beginnings and acknowledgements of the old ones, and stores changes.
void AttentionList::merge(const std::string& robot_id, std::vector<AttentionReason> old,
                          std::vector<AttentionReason>& now) {
  const bool own = !robot_id.empty() && (!is_own_ || is_own_(robot_id));
  bool changed = false;
  for (AttentionReason& reason : now) {
    const auto before = std::ranges::find_if(old, [&](const AttentionReason& o) { return o.same(reason); });
    if (before != old.end()) {
      reason.since_utime_us = before->since_utime_us;
      reason.acknowledged = before->acknowledged;
      continue;
    }
    if (!reason.since_utime_us) reason.since_utime_us = services_.now_utime_us();
    if (own) record(robot_id, reason, true);
    changed = true;
  }
  for (AttentionReason& reason : old) {
    if (std::ranges::any_of(now, [&](const AttentionReason& n) { return n.same(reason); })) continue;
    if (!has_ended(robot_id, reason)) {
      now.push_back(std::move(reason));
      continue;
    }
    if (own) record(robot_id, reason, false);
    changed = true;
  }
  order(now);
  // A robot without a robot file is stored only when someone acknowledged.
  const bool stored =
      services_.models.find(robot_id) != nullptr ||
      std::ranges::any_of(old, &std::optional<Acknowledgement>::has_value, &AttentionReason::acknowledged);
  if (!changed || !own || !stored) return;
  if (const auto posted = services_.writer.offer(
          history::PutLearned{{robot_id, topic, services_.now_utime_us(), reasons_json(now)}});
      !posted)
    on_error_(posted.error());
}

void AttentionList::look() {
  const auto time = std::chrono::steady_clock::now();
  bool renewed = false;
  if (!read_at_ || time - *read_at_ >= findings_period) {
    Reasons read;
    Result<void> done = add_diagnoses(read, services_);
    if (done) done = add_proposals(read, services_);
    if (!done) {
      on_error_(done.error());
    } else {
      findings_ = std::move(read);
      read_at_ = time;
      renewed = true;
    }
  }
  Reasons now = found();
  const std::lock_guard changing(changing_);
  Reasons before;
  {
    const std::lock_guard lock(mutex_);
    before = shown_;
  }
  for (auto& [robot_id, reasons] : now) {
    const auto known = before.find(robot_id);
    // Another daemon of a cluster may have stored an acknowledgement.
    const bool reread = services_.cluster != nullptr && renewed && !reasons.empty();
    merge(robot_id, known == before.end() || reread ? remembered(robot_id) : std::move(known->second),
          reasons);
  }
  const std::lock_guard lock(mutex_);
  shown_ = std::move(now);
}

Part attention_part() {
  std::vector<TableRow> rows;
  rows.push_back(
      {{.method = Method::get,
        .path = "/v1/attention",
        .operation_id = "listAttention",
        .role = http::Role::read,
        .summary = "Robots that need attention now, the most urgent first, each with its reasons and "
                   "what to do",
        .response_schema = "attention"},
       answered_by(get_attention)});
  rows.push_back(
      {{.method = Method::post,
        .path = "/v1/robots/{id}/acknowledge",
        .operation_id = "acknowledgeAttention",
        .role = http::Role::operate,
        .summary = "Acknowledges a robot's reasons of one kind, with a note, until their condition ends",
        .request_schema = "acknowledge-request",
        .response_schema = "attention-entry",
        .error_statuses = {404, 422},
        .run = http::Run::write},
       answered_by(acknowledge)});
  return {std::move(rows)};
}

}  // namespace joulecast::api
