#pragma once

#include <string>

#include "base/error.h"
#include "gap/verdict/offer.h"
#include "history/store.h"
#include "robot/robot_model.h"

namespace joulecast::server {

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
