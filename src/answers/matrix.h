#pragma once

#include <chrono>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "answers/drive.h"
#include "answers/model.h"
#include "describe/schema.h"
#include "planning/cost_matrix.h"
#include "planning/cost_table.h"

namespace joulecast::answers {

struct MatrixInput {
  struct Robot {
    std::string robot_id;
    std::optional<planning::Pose> pose;     // instead of the live one
    std::optional<double> state_of_charge;  // likewise
  };
  Driving driving = Driving::minimum_energy;
  planning::CostOptions options;           // of minimum-energy driving
  std::optional<double> reserve_fraction;  // instead of the robot files'
  std::vector<Robot> robots;
  std::vector<std::string> task_ids;
  std::vector<planning::MatrixTask> tasks;  // as many
  bool former = false;                      // members of the version before are used
};

// Access to the fleet's models and live states.
struct MatrixFleet {
  std::function<Result<std::shared_ptr<const ModelInForce>>(const std::string& robot_id)> model;
  std::function<LiveRobot(const std::string& robot_id)> live;
  std::function<RobotOutlook(const std::shared_ptr<const ModelInForce>& model)> outlook;
};

// One robot on every task, a value a task; NaN where it cannot do it.
struct MatrixRow {
  struct Infeasible {
    planning::Obstacle reason = planning::Obstacle::none;
    std::string detail;
    std::vector<std::string> task_ids;
  };
  std::string robot_id;
  std::optional<std::int64_t> model_version;
  std::optional<double> interpolation_error;  // of minimum-energy driving
  std::vector<std::string> neglected_effects;
  std::vector<double> energy_j, duration_s;
  std::optional<std::vector<double>> success_probability;  // absent: unknown charge
  // Where the robot's charge is too low for a task by itself: the least charge, in steps of 0.01, with which
  // it succeeds with 95 %; NaN where the charge suffices or a full one does not. The time to it at the
  // robot's charger [s]; 0 where the charge suffices, NaN where it is not known. Absent: unknown charge.
  std::optional<std::vector<double>> charge_needed, available_in_s;
  std::vector<Infeasible> infeasible;
  bool siblings_pending = false;  // of forecasts, as in RobotOutlook
};

// Every robot on every task. A problem of one robot, such as an unknown position, is in its row.
class Matrix {
 public:
  Matrix(MatrixInput input, const MatrixFleet& fleet, planning::CostTableCache& tables);

  const MatrixInput& input() const { return input_; }

  // Builds cost tables, on two threads, for at most `time`; false when all are built.
  bool prepare(std::chrono::milliseconds time, const std::stop_token& stop = {});
  // From any thread; after the last prepare().
  MatrixRow row(std::size_t robot, const std::stop_token& stop = {}) const;

 private:
  struct Robot {
    std::shared_ptr<const ModelInForce> model;  // null: see `problem`
    std::string problem;
    std::optional<planning::Pose> pose;
    std::optional<forecast::Charge> charge;
    double to_full_s = std::nan("");  // at the charger
    RobotOutlook outlook;             // where the charge is available or usual driving is requested
  };

  Robot robot_of(const MatrixInput::Robot& given, const MatrixFleet& fleet) const;
  void assemble();
  std::vector<planning::Cell> usual_cells(std::size_t r, MatrixRow& out,
                                          std::optional<Error>& obstacle) const;
  void state_success(const Robot& robot, const std::vector<planning::Cell>& cells, MatrixRow& out) const;
  static void state_availability(const Robot& robot, MatrixRow& out);
  std::string detail_of(planning::Obstacle obstacle, std::size_t r, const std::optional<Error>& limits) const;

  MatrixInput input_;
  std::vector<Robot> robots_;
  planning::CostTableCache& cache_;

  // Of minimum-energy driving: tables, one for each different model, then the matrix.
  std::vector<const ModelInForce*> models_;
  std::vector<Result<std::shared_ptr<const planning::CostTable>>> tables_;
  std::size_t tables_done_ = 0;
  std::unique_ptr<planning::CostMatrix> matrix_;
};

// "energy-matrix-request", "energy-matrix" and those to which they refer.
described::Schemas matrix_schemas();
// Errors name the field; too many cells are Fault::too_large.
Result<MatrixInput> read_matrix(const nlohmann::json& request);

// The answer, written piece by piece.
class MatrixText {
 public:
  explicit MatrixText(Matrix matrix) : matrix_(std::move(matrix)) {}

  // Appends the next piece; false after the last one, or when `left` is set. Works on two threads.
  bool next(std::string& out, const std::stop_token& left);

 private:
  Matrix matrix_;
  bool begun_ = false;
  std::size_t rows_done_ = 0;
};

}  // namespace joulecast::answers
