#include <nlohmann/json.hpp>

#include "answers/autonomy.h"
#include "answers/estimate.h"
#include "answers/matrix.h"
#include "answers/profile.h"
#include "base/json_text.h"
#include "fuzz.h"
#include "robot/robot_file.h"
#include "server/api/requests.h"

using namespace joulecast;

JOULECAST_FUZZ_TARGET(requests) {
  static const robot::RobotModel robot =
      robot::load_robot(JOULECAST_SOURCE_DIR "/deploy/robots/amr.json").value();
  const auto request = parse_json(testing::as_text(data, size));
  if (!request) return;
  (void)answers::read_profile(*request, robot);
  (void)answers::read_estimate(*request, robot);
  (void)answers::read_matrix(*request);
  for (const bool single : {false, true}) (void)answers::read_autonomy(*request, single);
  (void)api::read_model_request(*request);
  (void)api::read_diagnosis_request(*request);
}
