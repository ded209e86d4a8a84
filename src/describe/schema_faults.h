#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "describe/schema.h"

namespace joulecast::described {

// A departure of a JSON document from its schema: the JSON pointer of a member, and a sentence.
struct SchemaFault {
  std::string field, says;
};

// All departures, in the order of the schema; empty: none. Keywords of JSON Schema 2020-12 that are checked:
// $ref within the schema, type, enum, pattern, bounds of numbers and sizes, not with const, items,
// properties, required, additionalProperties, unevaluatedProperties, propertyNames and oneOf. Patterns must
// be bounded.
std::vector<SchemaFault> schema_faults(const Schema& schema, const nlohmann::json& document);

}  // namespace joulecast::described
