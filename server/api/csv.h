#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/http/message.h"

namespace joulecast::api {

// A table as text/csv (RFC 4180) with one line of titles; unmeasured values are empty fields. A text that a
// spreadsheet would interpret as a formula is preceded by an apostrophe.
class Csv {
 public:
  // Numbers have the precision of the request's ?digits=. A column is a member of the items, titled by its
  // name: "state", "energy/battery_j", with another title "x_m=pose/0". "annulled?": whether there is one.
  // Blanks separate columns.
  Csv(const http::Request& request, std::string_view columns);

  Csv& field(std::string_view text);
  Csv& field(const char* text) { return field(std::string_view(text)); }
  Csv& field(double number);  // resolved() (base/json_writer.h) and rounded
  Csv& exact(double number);  // all digits, for raw data
  Csv& field(std::int64_t number);
  Csv& field(bool truth) { return field(truth ? "true" : "false"); }
  void end_row();
  // A row of an item's JSON. Null: an empty field; an array: texts with blanks between; an object: JSON.
  void row(const std::string& item);

  // `name` is the file's name without its extension; next_cursor that of a page of a list.
  http::Response response(const std::string& name, std::string_view next_cursor = {});

 private:
  void separate() {
    if (std::exchange(comma_, true)) text_ += ',';
  }

  std::vector<std::string> columns_;
  int digits_;
  std::string text_;
  bool comma_ = false;
};

}  // namespace joulecast::api
