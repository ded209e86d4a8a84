#pragma once

#include <array>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gap/diagnosis.h"
#include "gap/mission_runs.h"
#include "gap/run_evidence.h"

namespace joulecast::gap {

// Runs that were predicted by a diagnosis made without them.
struct LeftOut {
  std::string what;  // "each run" (or "each fold" of many runs), or the condition whose runs are left out
                     // together: "payload_kg 8.25"
  std::size_t runs = 0;
  double before = 0, after = 0;      // mean absolute error of the run energy, relative to the measured one
  std::array<double, 2> interval{};  // of the fall 1 - after/before, 95 %, bootstrap over runs
  std::vector<std::string> effects;  // named without them
};

// One run, what the model says and what it says with the effects found.
struct JudgedRun {
  MissionRun run;
  double model_j = 0;
  double after_j = 0;     // with the effects, fitted to all runs
  double held_out_j = 0;  // with the effects named and fitted without this run
};

// Whether wheel speeds computed as (2v +- l yaw)/(2r) with l half the track, thesis (3-6), are behind the
// difference between the sides: their turning term is half of the right one.
struct TurningTerm {
  std::size_t runs = 0;
  double side_difference = 0;      // that the term would make, mean, relative to a run's energy
  double sum = 0;                  // that it would change the sum of both motors by, likewise
  double share = 0, share_sd = 0;  // of the term found in the measured side differences: 1 if it is halved
  double motor_error_before = 0, motor_error_after = 0;  // mean absolute, of single motors, in turns
};

// The answer where nothing is known but the energies of runs and their conditions.
struct MissionDiagnosis {
  std::string robot_id;
  bool model_given = false;    // the file gave the model's energies; otherwise the robot file was asked
  double model_ratio = 1;      // of the given energies to those of the robot file under the conditions
  double energy_relative = 0;  // (E_measured - E_model) / E_measured
  double error = 0;            // mean absolute error of the model, relative to the measured energy
  double scatter = 0;          // the part of it that scatter from run to run alone makes
  RunScatter scatters;
  Verdict verdict = Verdict::inconclusive;
  double verdict_probability = 0;
  std::vector<DiagnosedEffect> effects;
  std::string outside;  // condition that something outside the catalogue follows
  double outside_probability = 0;
  LeftOut left_out;  // run by run
  std::size_t folds = 0;
  std::size_t folds_agreeing = 0;   // of those, with the same effects named, up to what cannot be told apart
  std::vector<LeftOut> conditions;  // condition by condition, and table by table
  std::optional<TurningTerm> turning;
  std::vector<std::string> limits;       // what these energies cannot tell, in sentences
  std::vector<std::string> not_visible;  // effects that move none of these energies
  std::vector<JudgedRun> runs;
  std::vector<robot::AdoptedEffect> adoptable;
};

struct MissionSettings {
  bool robot_file_model = false;         // judge the robot file even where runs bring a model's energies
  std::function<bool(double)> progress;  // called with 0..1; false cancels
};

// Fault::invalid for a robot whose adopted effects the catalogue rejects, Fault::conflict when cancelled.
Result<MissionDiagnosis> diagnose_runs(std::span<const MissionRun> runs, const robot::RobotModel& robot,
                                       const MissionSettings& settings = {});

nlohmann::json to_json(const MissionDiagnosis& diagnosis);

}  // namespace joulecast::gap
