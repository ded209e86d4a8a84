#include "server/api/attention.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "base/fault_boundary.h"
#include "base/host_clock.h"
#include "base/json_number.h"
#include "base/try.h"
#include "base/utc_time.h"
#include "describe/input.h"
#include "server/api/change.h"
#include "server/api/robot_json.h"
#include "server/api/services.h"

namespace joulecast::api {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Acknowledgement, utime_us, by, note)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(AttentionReason, kind, subject, severity, message, action)

namespace {

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

std::vector<std::string_view> attention_kinds() {
  std::vector<std::string_view> names;
  for (const AttentionKind& kind : kinds) names.push_back(kind.name);
  return names;
}

// By which reasons are in order.
std::pair<bool, Severity> urgency(const AttentionReason& r) {
  return {r.acknowledged.has_value(), r.severity};
}

// What to do about a contradiction that no corrected value of its channel ends.
constexpr std::pair<std::string_view, std::string_view> other_actions[] = {
    {"sequence_skipping", "Check the robot's network, and that it publishes every message that it counts."},
    {"second_sender", "Give each robot its own robot_id."},
    {"utime_slow", "Publish the robot's telemetry more often."},
    {"clock_ahead", "Set the robot's clock."},
    {"clock_far_ahead", "Set the robot's clock."},
    {"undecodable", "Build the robot's publisher with the message types of lcmtypes."}};

std::string action_for(const ingest::Contradiction& c) {
  using Action = std::pair<std::string_view, std::string_view>;
  const auto* other = std::ranges::find(other_actions, c.id, &Action::first);
  std::string action = other != std::end(other_actions) ? std::string(other->second)
                       : c.channel.empty()              ? "Correct the robot's telemetry."
                                           : "Correct " + c.channel + " in the robot's telemetry.";
  return c.untrue ? action + " Until then its missions are not used for training." : action;
}

void add_telemetry(std::vector<AttentionReason>& reasons, const ingest::RobotSnapshot& s,
                   const ingest::ModelInForce* model, std::int64_t now_utime_us) {
  for (const ingest::Contradiction& c : s.contradictions)
    reasons.push_back(
        {"contradicted", Severity::fault, c.told_utime_us, c.says, action_for(c), c.id + ' ' + c.channel});
  const bool live = is_live(s, now_utime_us);
  if (!live && s.received_utime_us > 0 && !s.mission_id.empty())
    reasons.push_back({"silent", Severity::fault, s.received_utime_us,
                       fmt::format("No telemetry since {} during mission {}.",
                                   utc_text(s.received_utime_us).substr(0, 19), s.mission_id),
                       "Check the robot's power and its network."});
  if (live && model == nullptr)
    reasons.push_back({"no_robot_file", Severity::warning, std::nullopt,
                       "It has no robot file: its telemetry is counted, not recorded.",
                       "Add its robot file on its page."});
  if (live && model != nullptr && !battery::at_charger(s.charge.phase) &&
      s.state_of_charge < model->robot.battery.reserve_fraction)  // false for NaN
    reasons.push_back({"charge_low", Severity::warning, std::nullopt,
                       fmt::format("Charge {:.0f} %, below the reserve of {:.0f} %.", 100 * s.state_of_charge,
                                   100 * model->robot.battery.reserve_fraction),
                       "Send it to a charger."});
}

std::string_view words_of(drift::Quantity quantity) {
  return quantity == drift::Quantity::mass ? "Its mass, estimated from accelerations,"
                                           : "The internal resistance of its battery";
}

void add_watch(std::vector<AttentionReason>& reasons, const server::WatchFinding& found,
               std::int64_t version_in_force) {
  const auto change = [](double share) {
    return fmt::format("{:.1f} % {} energy", 100 * std::abs(share), share < 0 ? "less" : "more");
  };
  if (found.change && found.change->model_version == version_in_force) {
    const drift::Mark& mark = *found.change;
    const std::string day = utc_text(mark.utime_us).substr(0, 10);
    reasons.push_back({"drift", Severity::warning, mark.utime_us,
                       mark.quantity == drift::Quantity::energy
                           ? fmt::format("Uses {} than before {}.", change(mark.change()), day)
                           : fmt::format("{} has changed by {:+.1f} % since {}.", words_of(mark.quantity),
                                         100 * mark.change(), day),
                       "Start a diagnosis, or compare it with robots of its kind.",
                       std::to_string(mark.utime_us)});
  }
  if (found.among_kind && found.among_kind->stands_out)
    reasons.push_back({"stands_out", Severity::notice, std::nullopt,
                       fmt::format("Uses {} than its model predicts, unlike the other robots of its kind.",
                                   change(found.among_kind->ratio - 1)),
                       "Check its payload, tyres and floor, or start a diagnosis."});
}

// The newest diagnosis of each robot, where it names effects and no model was adopted since.
Result<void> add_diagnoses(std::map<std::string, std::vector<AttentionReason>>& reasons,
                           const Services& services) {
  TRY_ASSIGN(const auto found, services.store.diagnoses({}, history::whole_future, history::max_page_size));
  std::set<std::string> seen;
  for (const history::DiagnosisRecord& d : found) {
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
    reasons.push_back({"store", Severity::fault, std::nullopt,
                       "The store does not commit: " + status.error + ".",
                       "Check the disk or the database; the daemon retries automatically."});
  if (services.cluster == nullptr) return;
  if (const server::ClusterStatus status = services.cluster->status(); !status.error.empty())
    reasons.push_back({"cluster", Severity::fault, std::nullopt,
                       "The cluster's database was not reached: " + status.error + ".",
                       "Check the database and the network between them."});
}

// The stored form of a robot's reasons.
std::string reasons_json(const std::vector<AttentionReason>& reasons) {
  nlohmann::json list = reasons;
  for (std::size_t k = 0; k < reasons.size(); ++k) {
    if (reasons[k].since_utime_us) list[k]["since_utime_us"] = *reasons[k].since_utime_us;
    if (reasons[k].acknowledged) list[k]["acknowledged"] = *reasons[k].acknowledged;
  }
  return json_text(nlohmann::json{{"reasons", std::move(list)}});
}

// Throws nlohmann::json::exception for another form.
std::vector<AttentionReason> reasons_from(const std::string& body_json) {
  const auto list = nlohmann::json::parse(body_json).at("reasons");
  auto reasons = list.get<std::vector<AttentionReason>>();
  for (std::size_t k = 0; k < reasons.size(); ++k) {
    reasons[k].severity = std::clamp(reasons[k].severity, Severity::fault, Severity::notice);
    if (list[k].contains("since_utime_us")) reasons[k].since_utime_us = list[k]["since_utime_us"];
    if (list[k].contains("acknowledged")) reasons[k].acknowledged = list[k]["acknowledged"];
  }
  return reasons;
}

const auto acknowledgement_table =
    Table<Acknowledgement>()
        .time("", AT(utime_us), "time of the acknowledgement, microseconds since 1970")
        .text_or_null("by", AT(by), "name of the token; null: anonymous")
        .value("note", AT(note), "note of the person");
const auto reason_table =
    Table<AttentionReason>()
        .word("kind", AT(kind), attention_kinds(), "the condition")
        .word("severity", AT(severity), severity_names, "as above")
        .time("since", AT(since_utime_us),
              "start of the condition, microseconds since 1970; null: not available")
        .value("message", AT(message), "the condition in one sentence, with its number")
        .value("action", AT(action), "the required action, in one sentence")
        .object("acknowledged", AT(acknowledged),
                "acknowledgement, valid until the condition ends; null: not acknowledged",
                acknowledgement_table);
const auto attention_entry_table =
    Table<AttentionEntry>("A robot that needs attention")
        .named("attention-entry")
        .text_or_null("robot_id", AT(robot_id), "the robot; null: the service itself")
        .word("severity", AT(reasons.front().severity), severity_names,
              "severity of its first reason. fault: data are wrong or missing; warning: a robot or its model "
              "needs a person; notice: for information")
        .value("acknowledged", AT(reasons.front().acknowledged.has_value()),
               "whether all its reasons are acknowledged")
        .list("reasons", AT(reasons), "the unacknowledged ones first, then the most urgent", reason_table,
              {{"minItems", 1}});

struct Attention {
  std::vector<AttentionEntry> entries;
  std::int64_t count(std::size_t severity) const {
    return std::ranges::count_if(entries, [&](const AttentionEntry& e) {
      const AttentionReason& worst = e.reasons.front();
      return !worst.acknowledged && worst.severity == static_cast<Severity>(severity);
    });
  }
};

const auto counts_table = [] {
  Table<Attention> each;
  for (std::size_t k = 0; k < std::size(severity_names); ++k) {
    const std::string name(severity_names[k]);
    each.value(name, [k](const Attention& a) { return a.count(k); },
               "entries of severity " + name + " with an unacknowledged reason", {{"minimum", 0}});
  }
  return each;
}();
const auto attention_table =
    Table<Attention>("Robots that need attention")
        .list("attention", AT(entries),
              "one entry for each robot with a reason: those with an unacknowledged reason first, then the "
              "most urgent, then by robot id",
              attention_entry_table)
        .object("counts", std::identity(), "unacknowledged entries by severity", counts_table);

struct AcknowledgeRequest {
  std::size_t kind = 0;  // of kinds
  std::string note;
};

const auto acknowledge_input =
    described::Input<AcknowledgeRequest>("Acknowledgement of a robot's reasons for attention")
        .choice("kind", &AcknowledgeRequest::kind, attention_kinds(),
                "kind of the reasons, as GET /v1/attention lists it")
        .text("note", &AcknowledgeRequest::note, most_note, "what is being done about it; may be empty");

Result<Response> get_attention(const Services& services, const Request&) {
  return http::json_response(attention_table.text({services.attention->entries()}));
}

Result<Response> acknowledge(const Services& services, const Request& request) {
  const std::string& robot_id = request.param("id");
  if (services.models.find(robot_id) == nullptr && services.fleet.find(robot_id) == nullptr)
    return tl::unexpected(ingest::unknown_robot("id", robot_id));
  TRY_ASSIGN(const auto wanted, acknowledge_input.read(*request.json));
  RequestChange request_change(services, request);
  return request_change.result(
      services.attention->acknowledge(robot_id, kinds[wanted.kind].name,
                                      {services.now_utime_us(), request.actor, wanted.note}, request_change));
}

}  // namespace

void AttentionList::start() {
  thread_ = std::jthread([this](const std::stop_token& stop) {
    do {
      survive("attention", [this] { look(); });
    } while (sleep_for(stop, std::chrono::seconds(1)));
  });
}

std::vector<AttentionEntry> AttentionList::entries() const {
  std::vector<AttentionEntry> entries;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [robot_id, reasons] : shown_)
      if (!reasons.empty()) entries.push_back({robot_id, reasons});
  }
  std::ranges::stable_sort(entries, {}, [](const AttentionEntry& e) { return urgency(e.reasons.front()); });
  return entries;
}

history::Outcome AttentionList::acknowledge(const std::string& robot_id, std::string_view kind,
                                            const Acknowledgement& by, RequestChange& change) {
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
  if (!any)
    return fail(Fault::not_found, "kind",
                "robot " + robot_id + " has no reason of kind " + std::string(kind));
  std::ranges::stable_sort(entry.reasons, {}, urgency);
  const history::Outcome done = services_.writer.execute(change.answered_by(
      [entry](std::int64_t) { return http::json_response(attention_entry_table.text(entry)); },
      history::PutLearned{{robot_id, topic, by.utime_us, reasons_json(entry.reasons)}}));
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
  if (robot_id.empty() || reason.kind == "contradicted" || reason.kind == "no_robot_file") return true;
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
  if (const auto posted = services_.writer.offer(history::AppendEvent{
          {0, services_.now_utime_us(), robot_id, std::string(event), json_text(detail)}});
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
  std::ranges::stable_sort(now, {}, urgency);
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
  Part part{.schemas = {{"acknowledge-request", acknowledge_input.schema()}}};
  part.add(Method::get, "/v1/attention", "listAttention", Role::read,
           "Robots that need attention now, the most urgent first, each with its reasons and what to do",
           {"attention", attention_table.schema()}, get_attention);
  part.add(Method::post, "/v1/robots/{id}/acknowledge", "acknowledgeAttention", Role::operate,
           "Acknowledges a robot's reasons of one kind, with a note, until their condition ends",
           {"attention-entry", attention_entry_table.schema()}, acknowledge,
           {.request_schema = "acknowledge-request", .error_statuses = {404}, .run = Run::write});
  return part;
}

}  // namespace joulecast::api
