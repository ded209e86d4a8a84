#include <gtest/gtest.h>

#include <string>

#include "describe/schema.h"

namespace joulecast::described {
namespace {

const Schema& schema() {
  static const Schema one = Schema::parse(R"({
    "type": "object", "$ref": "#/$defs/base", "unevaluatedProperties": false, "required": ["size"],
    "properties": {
      "size": {"type": "number", "exclusiveMinimum": 0, "maximum": 5, "not": {"const": 3}},
      "count": {"type": "integer"},
      "pair": {"type": "array", "minItems": 2, "maxItems": 2, "items": {"$ref": "#/$defs/word"}},
      "by_name": {"type": "object", "maxProperties": 2, "propertyNames": {"$ref": "#/$defs/word"},
                  "additionalProperties": {"type": "boolean"}},
      "either": {"oneOf": [{"$ref": "#/$defs/word"}, {"type": "object", "required": ["a"],
                 "additionalProperties": false, "properties": {"a": {"type": "number"}}}]},
      "source": {"type": "object", "oneOf": [{"required": ["column", "unit"]}, {"required": ["rate"]}]}},
    "$defs": {"word": {"type": "string", "pattern": "^[a-z]{1,4}$", "description": "1 to 4 letters"},
              "base": {"type": "object", "required": ["kind"],
                       "properties": {"kind": {"enum": ["one", "two"]}, "name": {"type": "string", "minLength": 1}}}}
  })");
  return one;
}

// Pointers and sentences of a valid document to which these members are added.
std::string faults_of(const std::string& members) {
  std::string text = R"({"kind": "one", "size": 1)";
  if (!members.empty()) text += ", " + members;
  std::string all;
  for (const auto& [field, says] : schema_faults(schema(), nlohmann::json::parse(text + "}")))
    all += field + " " + says + "\n";
  return all;
}

TEST(SchemaFaults, AcceptsValidDocuments) {
  for (const char* members : {"", R"("count": -2, "pair": ["a", "bc"], "name": "x")", R"("either": "abc")",
                              R"("either": {"a": 2.5})", R"("source": {"rate": 1})",
                              R"("source": {"column": 1, "unit": 2}, "by_name": {"p": true, "q": false})"})
    EXPECT_EQ(faults_of(members), "") << members;
}

TEST(SchemaFaults, NamesMemberAndRule) {
  const std::pair<const char*, const char*> cases[] = {
      {R"("size": 0)", "/size must be greater than 0 and at most 5\n"},
      {R"("size": 6)", "/size must be greater than 0 and at most 5\n"},
      {R"("size": 3)", "/size must not be 3\n"},
      {R"("size": "1")", "/size must be a number\n"},
      {R"("count": 1.5)", "/count must be a whole number\n"},
      {R"("kind": "three")", "/kind must be one of one, two\n"},
      {R"("name": "")", "/name must be at least 1 characters\n"},
      {R"("pair": ["a"])", "/pair must be at least 2 items and at most 2 items\n"},
      {R"("pair": ["a", "Bc"])", "/pair/1 must be 1 to 4 letters\n"},
      {R"("by_name": {"p1": true})", "/by_name/p1 must be 1 to 4 letters\n"},
      {R"("by_name": {"p": 1})", "/by_name/p must be true or false\n"},
      {R"("by_name": {"p": true, "q": true, "r": true})", "/by_name must be at most 2 members\n"},
      {R"("either": 5)", "/either must be a string or an object\n"},
      {R"("either": {"a": "x"})", "/either/a must be a number\n"},
      {R"("either": {})", "/either/a is missing\n"},
      {R"("source": {"unit": 2})", "/source must have exactly one of column with unit, rate\n"},
      {R"("source": {"column": 1, "unit": 2, "rate": 3})",
       "/source must have exactly one of column with unit, rate\n"},
      {R"("naem": "x")", "/naem is an unknown member; did you mean name?\n"}};
  for (const auto& [members, expected] : cases) EXPECT_EQ(faults_of(members), expected) << members;
}

TEST(SchemaFaults, ReportsEveryFault) {
  const auto faults = schema_faults(schema(), nlohmann::json::parse(R"({"size": 9, "what": 1})"));
  ASSERT_EQ(faults.size(), 3u);
  EXPECT_EQ(faults[0].field, "/what");
  EXPECT_EQ(faults[1].field, "/size");
  EXPECT_EQ(faults[2].field, "/kind");
  EXPECT_EQ(schema_faults(schema(), nlohmann::json::array()).at(0).says, "must be an object");
}

}  // namespace
}  // namespace joulecast::described
