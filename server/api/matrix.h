#pragma once

#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <stop_token>
#include <string>

#include "base/error.h"
#include "forecast/outlook.h"
#include "planning/cost_table_cache.h"
#include "planning/path.h"
#include "server/ingest/forecasts.h"
#include "server/ingest/model_registry.h"

namespace joulecast::api {

// What a matrix request needs to know of the fleet.
struct MatrixFleet {
  std::function<Result<std::shared_ptr<const server::ModelInForce>>(const std::string& robot_id)> model;
  std::function<std::optional<planning::Pose>(const std::string& robot_id)> pose;  // where it stands now
  // What success probabilities rest on; empty: none are told.
  std::function<server::RobotOutlook(const std::shared_ptr<const server::ModelInForce>& model)> outlook = {};
  // What is known of its charge: given with the request, else live. NaN: nothing.
  std::function<forecast::Charge(const server::ModelInForce& model, const std::optional<double>& given,
                                 const std::optional<double>& reserve)>
      charge = {};
};

// The answer to one energy-matrix request, written piece by piece: a row of JSON for each robot.
class MatrixAnswer {
 public:
  // Reads and checks the request. Errors name the field; too many cells are Fault::too_large. What is amiss
  // with one robot, that it is not known or nobody knows where it stands, is told in its row.
  static Result<std::shared_ptr<MatrixAnswer>> make(const nlohmann::json& request, const MatrixFleet& fleet,
                                                    planning::CostTableCache& tables);
  ~MatrixAnswer();

  // Appends the next piece; false after the last one, or when `left` is set. Works on two threads.
  bool next(std::string& out, const std::stop_token& left);

 private:
  struct State;
  explicit MatrixAnswer(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace joulecast::api
