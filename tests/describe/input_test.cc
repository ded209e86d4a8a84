#include "describe/input.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <variant>

#include "describe/table.h"

using namespace joulecast;
using namespace joulecast::described;
using nlohmann::json;

namespace {

enum class Speed { slow, fast };

struct Circle {
  double radius_m = 0;
};
struct Line {
  double length_m = 0;
};
using Shape = std::variant<Line, Circle>;

struct Part {
  std::string name;
  std::optional<double> mass_kg;
};

struct Order {
  std::string id;
  double load_kg = 0;
  std::optional<double> deadline_s;
  Speed speed = Speed::slow;
  bool urgent = false;
  std::vector<Shape> shapes;
  std::vector<Part> parts;
};

// The context of the reader.
struct Robot {
  double limit_kg = 0;
};

const Input<Order, Robot>& order() {
  static const auto part = Input<Part>()
                               .text("name", &Part::name, 8, "name of the part")
                               .number("mass_kg", &Part::mass_kg, positive, "mass of the part");
  static const auto shape =
      Variants<Shape>("kind")
          .of("line", "a line", Input<Line>().number("length_m", &Line::length_m, positive, "length"))
          .of("circle", "a circle",
              Input<Circle>().number("radius_m", &Circle::radius_m, positive, "radius"));
  static const auto input =
      Input<Order, Robot>("An order")
          .text("id", &Order::id, 4, "its name")
          .number("load_kg", &Order::load_kg, not_negative, "load", 1,
                  [](const Order&, const Robot& robot) {
                    return Limit{robot.limit_kg, "limit_kg of the cart"};
                  })
          .number("deadline_s", &Order::deadline_s, positive, "latest end")
          .choice("speed", &Order::speed, std::array{"slow", "fast"}, "speed", 0)
          .boolean("urgent", &Order::urgent, "goes first", false)
          .list("shapes", &Order::shapes, {0, 2, "shapes"}, "ways", shape, Presence::optional)
          .list("parts", &Order::parts, {1, 3, "parts"}, "parts", OrText(&Part::name, "name of a part", part),
                Presence::optional)
          .check([](Fields& fields, Order& read, Robot&) {
            if (read.urgent && !read.deadline_s) fields.fault("deadline_s", "is required of urgent ones");
          })
          .finally([](Fields& fields, Order& read, Robot&) {
            if (read.id == "none") fields.fault("id", "is taken");
          });
  return input;
}

Result<Order> read(const json& body) {
  return order().read(body, {}, {.limit_kg = 10});
}

std::string fault_of(const json& body) {
  const auto found = read(body);
  return found ? "" : describe(found.error());
}

TEST(Input, ReadsAllMembers) {
  const auto found = read(json::parse(R"({"id": "a", "load_kg": 2.5, "deadline_s": 60, "speed": "fast",
      "urgent": true, "shapes": [{"kind": "circle", "radius_m": 2}, {"kind": "line", "length_m": 3}],
      "parts": ["bolt", {"name": "nut", "mass_kg": 0.5}]})"));
  ASSERT_TRUE(found) << describe(found.error());
  EXPECT_EQ(found->id, "a");
  EXPECT_EQ(found->load_kg, 2.5);
  EXPECT_EQ(found->deadline_s, 60);
  EXPECT_EQ(found->speed, Speed::fast);
  EXPECT_TRUE(found->urgent);
  ASSERT_EQ(found->shapes.size(), 2U);
  EXPECT_EQ(std::get<Circle>(found->shapes[0]).radius_m, 2);
  EXPECT_EQ(std::get<Line>(found->shapes[1]).length_m, 3);
  ASSERT_EQ(found->parts.size(), 2U);
  EXPECT_EQ(found->parts[0].name, "bolt");
  EXPECT_EQ(found->parts[1].mass_kg, 0.5);
}

TEST(Input, AbsentAndNullAreDefaults) {
  for (const char* body :
       {R"({"id": "a"})", R"({"id": "a", "load_kg": null, "deadline_s": null, "speed": null,
                                                "urgent": null, "shapes": null, "parts": null})"}) {
    const auto found = read(json::parse(body));
    ASSERT_TRUE(found) << describe(found.error());
    EXPECT_EQ(found->load_kg, 1);
    EXPECT_FALSE(found->deadline_s);
    EXPECT_EQ(found->speed, Speed::slow);
    EXPECT_TRUE(found->shapes.empty());
  }
}

TEST(Input, NamesFieldAndConstraint) {
  EXPECT_EQ(fault_of({{"ID", "a"}}), "/id: is required; unknown here: ID");
  EXPECT_EQ(fault_of({{"id", "abcde"}}), "/id: has 5 bytes, must have at most 4");
  EXPECT_EQ(fault_of({{"id", "a"}, {"load_kg", 11}}),
            "/load_kg: is 11, must be at most 10, limit_kg of the cart");
  EXPECT_EQ(fault_of({{"id", "a"}, {"speed", "late"}}), "/speed: is \"late\", must be one of slow, fast");
  EXPECT_EQ(fault_of({{"id", "a"}, {"parts", json::array()}}), "/parts: must be an array of 1 to 3 parts");
  EXPECT_EQ(fault_of({{"id", "a"}, {"shapes", {1, 2, 3}}}), "/shapes: must be an array of at most 2 shapes");
  EXPECT_EQ(fault_of({{"id", "a"}, {"shapes", {{{"kind", "cube"}}}}}),
            "/shapes/0/kind: is \"cube\", must be one of line, circle");
  EXPECT_EQ(fault_of({{"id", "a"}, {"parts", {"bolt", {{"name", "nut"}, {"mass_kg", 0}}}}}),
            "/parts/1/mass_kg: is 0, must be greater than 0");
  EXPECT_EQ(fault_of({{"id", "a"}, {"extra", 1}}), "/extra: is an unknown field");
  EXPECT_EQ(fault_of({{"id", "a"}, {"urgent", true}}), "/deadline_s: is required of urgent ones");
}

TEST(Input, FirstFaultIsReported) {
  EXPECT_EQ(fault_of({{"id", 1}, {"load_kg", -1}}), "/id: must be a text");
  // The last check waits for a valid rest.
  EXPECT_EQ(fault_of({{"id", "none"}, {"extra", 1}}), "/extra: is an unknown field");
  EXPECT_EQ(fault_of({{"id", "none"}}), "/id: is taken");
}

TEST(Input, SchemaStatesBoundsAndDefaults) {
  const json schema = json::parse(order().schema().dump());
  EXPECT_EQ(schema["required"], json::array({"id"}));
  EXPECT_EQ(schema["properties"]["load_kg"],
            json::parse(R"({"type": ["number", "null"], "minimum": 0, "description": "load; default 1"})"));
  EXPECT_EQ(schema["properties"]["speed"],
            json::parse(R"({"enum": ["slow", "fast", null], "description": "speed; default slow"})"));
  EXPECT_EQ(schema["properties"]["shapes"]["items"]["oneOf"][1], json::parse(R"({"type": "object",
      "properties": {"kind": {"const": "circle", "description": "a circle"},
                     "radius_m": {"type": "number", "exclusiveMinimum": 0, "description": "radius"}},
      "required": ["kind", "radius_m"], "additionalProperties": false})"));
  EXPECT_EQ(schema["properties"]["parts"]["items"]["oneOf"][0]["type"], "string");
}

struct Answer {
  std::string id;
  double gap = 0;
  std::optional<Part> part;
  std::vector<double> way_m;
};

TEST(Table, WritesWhatItsSchemaStates) {
  static const auto part = Table<Part>().named("part").value("name", &Part::name, "its name");
  const auto table = Table<Answer>("An answer")
                         .text_or_null("id", &Answer::id, "its name")
                         .known("gap", &Answer::gap, "left out if unknown")
                         .object("part", &Answer::part, "null: none", part)
                         .column("way_m", &Answer::way_m, "way", 2, true);
  const double unknown = std::nan("");
  EXPECT_EQ(table.text({"", unknown, {}, {1.234, unknown}}),
            R"({"id":null,"part":null,"way_m":[1.23,null]})");
  EXPECT_EQ(table.text({"a", 2, Part{"bolt", {}}, {}}),
            R"({"id":"a","gap":2,"part":{"name":"bolt"},"way_m":[]})");
  const json schema = json::parse(table.schema().dump());
  EXPECT_EQ(schema["required"], json::array({"id", "part", "way_m"}));
  EXPECT_EQ(schema["properties"]["part"]["anyOf"],
            json::parse(R"([{"$ref": "part.schema.json"}, {"type": "null"}])"));
}

}  // namespace
