#pragma once

#include <string>

#include "base/error.h"
#include "gap/verdict/offer.h"
#include "history/store.h"
#include "robot/robot_model.h"

namespace joulecast::server {

struct DiagnosedModel {
  robot::RobotModel model;
  std::string overridden;  // why the diagnosis says that it is not to be adopted, where `force` went over it;
                           // else empty
};

// The model version that a stored diagnosis was made with, with what it offers. Diagnoses of earlier versions
// of the service are read too. Fault::conflict of "/diagnosis_id" with the refusal or where there is nothing
// to adopt, of
// "/effect" where one of several effects has to be chosen; ::invalid of "/effect" for a choice that is not on
// offer.
Result<DiagnosedModel> diagnosed_model(const history::Store& store, const history::DiagnosisRecord& diagnosis,
                                       const gap::Choice& choice);

}  // namespace joulecast::server
