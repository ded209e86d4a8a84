#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/http/message.h"

namespace joulecast::api {

// A table as text/csv (RFC 4180) with one line of titles; what was not measured is an empty field. A text
// that a spreadsheet would take for a formula gets an apostrophe before it.
class Csv {
 public:
  // Numbers are as precise as the request's ?digits= says.
  Csv(const http::Request& request, const std::vector<std::string>& titles);

  Csv& field(std::string_view text);
  Csv& field(const std::string& text) { return field(std::string_view(text)); }
  Csv& field(const char* text) { return field(std::string_view(text)); }
  Csv& field(double number);  // resolved() (base/resolution.h) and rounded
  Csv& exact(double number);  // as it is, for evidence
  Csv& field(std::int64_t number);
  Csv& field(bool truth);
  Csv& field(std::optional<std::int64_t> number) { return number ? field(*number) : field(""); }
  void end_row();

  // `name`: of the file, without its extension.
  http::Response response(const std::string& name);
  // Of one page of a list: where one follows, the header Link names it (RFC 8288, rel="next").
  http::Response response(const std::string& name, const http::Request& request,
                          std::string_view next_cursor);

 private:
  void separate();

  int digits_;
  std::string text_;
  bool comma_ = false;
};

}  // namespace joulecast::api
