#include "server/api/requests.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/json_fields.h"
#include "base/try.h"

namespace joulecast::api {
namespace {

using Json = nlohmann::json;

constexpr std::int64_t greatest_id = std::int64_t{1} << 53;  // what JSON numbers hold exactly
constexpr std::size_t longest_note = 1000;
constexpr std::size_t most_effects = 16;
constexpr std::size_t max_diagnosed_missions = 1000;  // of one request
constexpr double most_held_back = 0.9;

std::vector<std::string> read_effects(Fields& fields) {
  const Json* given = fields.member("effect");
  if (given == nullptr) return {};
  const Json ids = given->is_string() ? Json::array({*given}) : *given;
  const auto is_text = [](const Json& id) { return id.is_string(); };
  if (!ids.is_array() || ids.size() > most_effects || !std::ranges::all_of(ids, is_text)) {
    fields.fault("effect",
                 "must be the id of an effect, or an array of at most " + std::to_string(most_effects));
    return {};
  }
  return ids.get<std::vector<std::string>>();
}

}  // namespace

Result<ModelRequest> read_model_request(const Json& body) {
  Fields fields(body);
  ModelRequest r;
  r.model = fields.member("model");
  r.diagnosis_id = fields.optional_integer("diagnosis_id", 1, greatest_id);
  r.effects = read_effects(fields);
  r.proposal_id = fields.optional_integer("proposal_id", 1, greatest_id);
  r.version = fields.optional_integer("version", 1, greatest_id);
  r.since_utime_us = fields.time("since");
  r.expected_version = fields.optional_integer("expected_version", 1, greatest_id);
  if (fields.has("note")) r.note = fields.text("note", longest_note);
  r.force = fields.boolean("force", false);
  r.dry_run = fields.boolean("dry_run", false);
  const int given =
      (r.model != nullptr) + r.diagnosis_id.has_value() + r.proposal_id.has_value() + r.version.has_value();
  if (fields.ok() && given != 1)
    fields.fault("model", "exactly one of model, diagnosis_id, proposal_id and version must be given, not " +
                              std::to_string(given));
  if (fields.ok() && !r.effects.empty() && !r.diagnosis_id)
    fields.fault("effect", "goes with diagnosis_id alone");
  if (fields.ok() && r.version && (r.force || r.dry_run || r.since_utime_us))
    fields.fault("version", "is put in force without a back-test: leave out force, dry_run and since");
  TRY(fields.finish());
  return r;
}

Result<server::DiagnosisRequest> read_diagnosis_request(const Json& body) {
  Fields fields(body);
  server::DiagnosisRequest wanted;
  wanted.robot_id = fields.text("robot_id", 64);
  if (const Json* missions = fields.member("missions")) {
    if (!missions->is_array() || missions->empty() || missions->size() > max_diagnosed_missions)
      fields.fault("missions",
                   "must be an array of 1 to " + std::to_string(max_diagnosed_missions) + " mission ids");
    for (std::size_t k = 0; fields.ok() && k < missions->size(); ++k) {
      if (!(*missions)[k].is_number_integer() || (*missions)[k] < 1) {
        fields.fault("missions/" + std::to_string(k), "must be a positive integer, the id of a mission");
      } else {
        wanted.missions.push_back((*missions)[k].get<std::int64_t>());
      }
    }
  }
  wanted.since_utime_us = fields.time("since");
  wanted.max_missions = static_cast<std::size_t>(
      fields.integer("max_missions", 1, static_cast<std::int64_t>(max_diagnosed_missions), 200));
  wanted.hold_back = fields.number("hold_back", {0, most_held_back}, wanted.hold_back);
  TRY(fields.finish());
  return wanted;
}

}  // namespace joulecast::api
