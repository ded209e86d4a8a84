#include "answers/json/mark_json.h"

namespace joulecast::answers {

const described::Table<drift::Mark>& mark_table() {
  using M = drift::Mark;
  static const auto table =
      described::Table<M>()
          .value("id", &M::mission_key, "the first mission after the change, as in /v1/missions/{id}")
          .time("start", &M::utime_us, "start of the mission, microseconds since 1970 by the robot's clock")
          .value("model_version", &M::model_version, "the version then in force")
          .word("quantity", &M::quantity_name, drift::quantity_names, "what changed, over the model's")
          .value("ratio_before", &M::before, "measured over modelled before the change")
          .value("ratio_after", &M::after, "the same after it, by the missions that revealed it")
          .numbers("change_ci", &M::interval, "95 % interval of the difference")
          .value("missions", &M::missions, "number of missions");
  return table;
}

}  // namespace joulecast::answers
