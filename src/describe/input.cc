#include "describe/input.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>

namespace joulecast::described {
const nlohmann::json* read_array(Fields& fields, std::string_view name, const Count& count,
                                 Presence presence) {
  const nlohmann::json* array = presence == Presence::required ? fields.required(name) : fields.member(name);
  if (array == nullptr) return nullptr;
  if (array->is_array() && array->size() >= count.minimum && array->size() <= count.maximum) return array;
  std::string message = "must be an array of ";
  message.append(count.minimum > 0 ? std::to_string(count.minimum).append(" to ") : "at most ");
  fields.fault(name, message.append(std::to_string(count.maximum)).append(" ").append(count.noun));
  return nullptr;
}

Schema of_number(double value) {
  if (std::nearbyint(value) == value) return static_cast<std::int64_t>(value);
  return value;
}

std::string above(double value, const Limit& limit) {
  return fmt::format("is {}, must be at most {}, {}", value, limit.value, limit.member);
}

Schema of_bounds(const Bounds& bounds) {
  Schema schema = of_type("number");
  if (std::isfinite(bounds.minimum))
    schema[bounds.exclusive_minimum ? "exclusiveMinimum" : "minimum"] = of_number(bounds.minimum);
  if (std::isfinite(bounds.maximum))
    schema[bounds.exclusive_maximum ? "exclusiveMaximum" : "maximum"] = of_number(bounds.maximum);
  return schema;
}

Schema of_count(const Count& count) {
  Schema schema = Schema::object();
  if (count.minimum > 0) schema["minItems"] = count.minimum;
  schema["maxItems"] = count.maximum;
  return schema;
}

}  // namespace joulecast::described
