#include "server/diagnosis/diagnosed_model.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "base/try.h"
#include "robot/robot_file.h"

namespace joulecast::server {
namespace {

Error as_of_request(Error error, const gap::Offer& offer) {
  if (error.field == "effect") error.field = "/effect";
  if (!error.field.empty()) return error;
  error.field = "/diagnosis_id";
  error.message = "Not adopted: " + error.message + ".";
  if (!offer.effects.empty()) error.message += " To adopt it all the same, set force.";
  return error;
}

}  // namespace

Result<DiagnosedModel> diagnosed_model(const history::Store& store, const history::DiagnosisRecord& diagnosis,
                                       const gap::Choice& choice) {
  if (diagnosis.result_json.empty() || !diagnosis.model_version)
    return fail(Fault::conflict, "/diagnosis_id", "holds nothing to adopt");
  const auto result = nlohmann::json::parse(diagnosis.result_json, nullptr, false);
  TRY_ASSIGN(const gap::Offer offer, gap::offer_from_json(result));
  TRY_ASSIGN(const history::ModelVersion version, store.model(diagnosis.robot_id, diagnosis.model_version));
  const Result<robot::RobotModel> robot = robot::parse_robot(version.model_json);
  if (!robot) return tl::unexpected(robot.error());
  Result<robot::RobotModel> model = gap::take(offer, *robot, choice);
  if (!model) return tl::unexpected(as_of_request(std::move(model.error()), offer));
  return DiagnosedModel{std::move(*model), offer.choice_settles ? "" : offer.refusal};
}

}  // namespace joulecast::server
