#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "describe/schema.h"
#include "server/diagnosis/diagnosis_service.h"

// Parsers of JSON request bodies with several fields. An error lists every invalid field.
namespace joulecast::api {

// The body of POST /v1/robots/{id}/models: one of four sources of the model, and options.
struct ModelRequest {
  const nlohmann::json* model = nullptr;  // within the body
  std::optional<std::int64_t> diagnosis_id, proposal_id, version;
  std::vector<std::string> effects;  // of those that the diagnosis does not distinguish, the ones to adopt
  std::optional<std::string> note;
  std::optional<std::int64_t> since_utime_us, expected_version;
  bool force = false, dry_run = false;
};

// "model-request" and "diagnosis-request".
described::Schemas request_schemas();

Result<ModelRequest> read_model_request(const nlohmann::json& body);

// The body of POST /v1/diagnoses.
Result<server::DiagnosisRequest> read_diagnosis_request(const nlohmann::json& body);

}  // namespace joulecast::api
