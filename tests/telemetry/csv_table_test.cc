#include "telemetry/csv_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>

namespace joulecast::telemetry {
namespace {

using ::testing::ElementsAre;
using Row = std::vector<std::string>;

// Header and rows, or the error's description.
struct Outcome {
  std::vector<Row> rows;
  std::string error;
};

Outcome read_all(std::string_view text, char separator = ',') {
  Outcome outcome;
  auto table = CsvTable::open(text, separator);
  if (!table) return {{}, describe(table.error())};
  outcome.rows.push_back(table->header());
  std::vector<std::string_view> fields;
  while (true) {
    auto read = table->next(fields);
    if (!read) outcome.error = describe(read.error());
    if (!read || !*read) return outcome;
    outcome.rows.emplace_back(fields.begin(), fields.end());
  }
}

TEST(CsvTable, ReadsEveryLineEnd) {
  const std::vector<Row> expected{{"a", "b"}, {"1", ""}, {"", "2"}};
  EXPECT_EQ(read_all("a,b\n1,\n,2\n").rows, expected);
  EXPECT_EQ(read_all("a,b\r\n1,\r\n,2").rows, expected);
  EXPECT_EQ(read_all("\xEF\xBB\xBF"
                     "a;b\n\n1;\n;2\n\n",
                     ';')
                .rows,
            expected);
}

TEST(CsvTable, ReadsQuotedFields) {
  const auto outcome = read_all("\"x[0,2]\",\"say \"\"hi\"\"\",\"\"\"\"\n\"two\nlines\",\"\",3\n");
  EXPECT_EQ(outcome.rows, (std::vector<Row>{{"x[0,2]", "say \"hi\"", "\""}, {"two\nlines", "", "3"}}));
}

TEST(CsvTable, ErrorsNameLine) {
  EXPECT_THAT(read_all("").error, ::testing::HasSubstr("line 1"));
  EXPECT_THAT(read_all(std::string("\x7f"
                                   "ELF\0\1",
                                   6))
                  .error,
              ::testing::HasSubstr("line 1: the header has zero bytes"));
  EXPECT_THAT(read_all("a,b\n1,2\n1,2,3\n").error,
              ::testing::HasSubstr("line 3: has 3 fields, the header 2"));
  EXPECT_THAT(read_all("a,b\n\"1\n2\",\"open\n").error,
              ::testing::HasSubstr("line 3: a quoted field is never closed"));
  EXPECT_THAT(read_all("a,b\n\"1\"x,2\n").error, ::testing::HasSubstr("line 2: text follows a quoted field"));
}

TEST(CsvTable, CountsLinesInsideQuotes) {
  auto table = CsvTable::open("a\n\"1\n2\"\n3\n", ',').value();
  std::vector<std::string_view> fields;
  ASSERT_TRUE(table.next(fields).value());
  EXPECT_EQ(table.line(), 2u);
  ASSERT_TRUE(table.next(fields).value());
  EXPECT_EQ(table.line(), 4u);
}

// Any texts round-trip when quoted by the rules.
TEST(CsvTable, AnyTextSurvivesQuoting) {
  EXPECT_TRUE(rc::check([] {
    const auto text = rc::gen::container<std::string>(rc::gen::elementOf(std::string("a\",;\n\r x")));
    const auto width = *rc::gen::inRange<std::size_t>(1, 5);
    const auto rows =
        *rc::gen::nonEmpty(rc::gen::container<std::vector<Row>>(rc::gen::container<Row>(width, text)));
    std::string csv;
    for (const Row& row : rows) {
      for (std::size_t i = 0; i < row.size(); ++i) {
        csv += i == 0 ? "\"" : ",\"";
        for (const char c : row[i]) csv.append(c == '"' ? 2 : 1, c);
        csv += '"';
      }
      csv += '\n';
    }
    const auto outcome = read_all(csv);
    RC_ASSERT(outcome.error.empty());
    RC_ASSERT(outcome.rows == rows);
  }));
}

}  // namespace
}  // namespace joulecast::telemetry
