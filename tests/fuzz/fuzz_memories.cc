#include "fuzz.h"
#include "ingest/charge_watch.h"
#include "ingest/forecasts.h"
#include "ingest/refinement_watch.h"
#include "robot/robot_file.h"

using namespace joulecast;

// Learnt state is stored as JSON text. Damaged text changes nothing or gives a state that can be stored.
JOULECAST_FUZZ_TARGET(memories) {
  static const robot::RobotModel robot =
      robot::load_robot(JOULECAST_SOURCE_DIR "/deploy/robots/amr.json").value();
  const std::string text(testing::as_text(data, size));
  ingest::ChargeWatch charge(robot);
  charge.recall(text);
  ingest::ChargeWatch again(robot);
  again.recall(charge.memory_json());
  ingest::RefinementWatch refinement(robot, 1);
  refinement.recall(text);
  (void)refinement.memory_json();
  if (const auto missions = ingest::legs_from_json(text)) {
    static const auto model = answers::model_in_force(robot, 1).value();
    forecast::RobotForecast forecast(model->robot, model->drive);
    for (const forecast::PastMission& mission : *missions) forecast.learn(mission);
    testing::require(ingest::legs_from_json(ingest::legs_json(*missions)).has_value());
  }
}
