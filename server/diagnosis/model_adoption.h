#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "describe/table.h"
#include "energy/back_test.h"
#include "gap/verdict/adopt.h"
#include "history/store.h"
#include "history/writer.h"
#include "ingest/model_registry.h"
#include "robot/robot_model.h"
#include "server/diagnosis/drift_view.h"
#include "server/diagnosis/mission_recordings.h"

namespace joulecast::server {

struct AdoptionRequest {
  robot::RobotModel model;                   // the candidate, for its robot_id
  std::optional<robot::RobotModel> against;  // compared with; absent: with the model in force
  std::size_t comparisons = 1;               // see energy::BackTestSettings
  history::ModelOrigin origin = history::ModelOrigin::http;
  std::string note;
  std::vector<history::MissionKey> fitted_on;  // left out of the back-test
  // Missions that started earlier are not tested on. Absent: those before the first that it was fitted on,
  // since the fit describes the robot as of then, and those before its last change of consumption, when
  // enough came after it.
  std::optional<std::int64_t> since_utime_us;
  // Conflict when another one is in force: as the request states, and of the model that was diagnosed.
  std::optional<std::int64_t> expected_version, diagnosed_version;
  std::optional<std::int64_t> diagnosis_id,
      proposal_id;         // its source; an adopted proposal is closed
  std::string overridden;  // why the diagnosis refuses adoption, where it is forced; else empty
  bool force = false;      // adopt even when the back-test does not show that it improves
  bool dry_run = false;    // back-test only
};

struct Adoption {
  bool adopted = false;
  std::int64_t version = 0;           // adopted, or the one that stays in force
  std::int64_t previous_version = 0;  // in force before, and compared with the candidate
  energy::BackTest test;
  LeftOut left_out;
  std::optional<std::int64_t> since_utime_us;  // tested on missions from then on; absent: on any
  std::string refusal;  // why it was not adopted; empty when it was, or on a dry run of one that would be
  std::string back_test_json;  // by back_test_table()
};

const described::Table<Adoption>& back_test_table();

struct AdoptionCounts {
  std::uint64_t adopted = 0;  // after a back-test that showed an improvement
  std::uint64_t forced = 0;   // without one
  std::uint64_t refused = 0;
};

struct AdoptionOptions {
  std::size_t most_robots = 10'000;  // that may have a model
  std::size_t max_missions = 50;
  std::size_t max_samples = 400'000;
  energy::MeterSettings meter;
};

// Adopts models as new versions after a back-test on the robot's own history: missions that the candidate was
// not fitted on are replayed from their stored telemetry through the meter, with the model in force and with
// the candidate. One back-test runs at a time.
//
// Planner and autonomy use an adopted model from the next request on. The meter changes over at the end of
// the open mission where the robot declares its missions, so that each mission's accounts are one model's;
// telemetry without declared missions may run for days and changes over immediately.
class ModelAdoption {
 public:
  ModelAdoption(Parts parts, const AdoptionOptions& options) : parts_(std::move(parts)), options_(options) {}

  // Fault::not_found: the robot has no model to test against; ::invalid: the candidate is no valid model;
  // ::conflict: another model came in force meanwhile; ::unavailable: another back-test is running, or the
  // store fails. A candidate that does not improve is no error: see Adoption::adopted.
  // `closing`: additions of a request to the transaction of an adoption, which has no version yet.
  Result<Adoption> adopt(const AdoptionRequest& request, const std::function<bool()>& go_on = {},
                         const std::function<history::Change(const Adoption&)>& closing = {});

  // Puts a user's model in force without a back-test, also for a robot without a model. Returns its version.
  // Fault::conflict: the greatest number of robots have a model.
  Result<std::int64_t> put(const robot::RobotModel& model, history::Change closing = {});

  // Puts a stored version in force without a back-test. Returns the version that was in force before.
  Result<std::int64_t> activate(const std::string& robot_id, std::int64_t version, const std::string& note,
                                const std::function<history::Change(std::int64_t before)>& closing = {});

  AdoptionCounts counts() const { return {adopted_, forced_, refused_}; }

 private:
  Result<StoredRecordings> history(const AdoptionRequest& request, const ingest::ModelInForce& before,
                                   std::optional<std::int64_t>& since_utime_us) const;
  // The back-test on the history: fills the members of the adoption that it decides.
  Result<void> test(const AdoptionRequest& request, const ingest::ModelInForce& before,
                    const std::function<bool()>& go_on, Adoption& adoption);
  // Stores the model and puts it in force.
  Result<std::int64_t> put(history::Change change, const robot::RobotModel& model);

  const Parts parts_;
  AdoptionOptions options_;
  std::atomic<std::uint64_t> adopted_ = 0, forced_ = 0, refused_ = 0;
  std::mutex testing_;  // one back-test at a time
  std::mutex putting_;  // a version and the registry change together
};

struct DiagnosedModel {
  robot::RobotModel model;
  std::string overridden;  // the diagnosis's refusal of adoption that `force` overrode; else empty
};

// The model version that a stored diagnosis was made with, extended by its findings. Diagnoses of earlier
// versions of the service are read too. Fault::conflict of "/diagnosis_id" with the refusal or where there is
// nothing to adopt, of "/effect" where one of several effects has to be chosen; ::invalid of "/effect" for a
// choice that is not available.
Result<DiagnosedModel> diagnosed_model(const history::Store& store, const history::DiagnosisRecord& diagnosis,
                                       const gap::Choice& choice);

}  // namespace joulecast::server
