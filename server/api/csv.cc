#include "server/api/csv.h"

#include <fmt/format.h>

#include <algorithm>
#include <initializer_list>
#include <nlohmann/json.hpp>

#include "base/json_writer.h"
#include "base/text.h"
#include "server/http/text.h"

namespace joulecast::api {
namespace {

// Whether a spreadsheet may read the text as a formula: it begins with one of OWASP's characters, or their
// full-width forms, behind blanks that spreadsheets trim
// (https://owasp.org/www-community/attacks/CSV_Injection).
bool may_be_formula(std::string_view text) {
  const auto begins_with = [&text](std::initializer_list<std::string_view> any) {
    return std::ranges::find_if(any, [&](std::string_view one) { return text.starts_with(one); });
  };
  const std::initializer_list<std::string_view> blanks{" ",      "\u00A0", "\u200B", "\u200C",
                                                       "\u200D", "\u2060", "\u3000", "\uFEFF"};
  for (auto blank = begins_with(blanks); blank != blanks.end(); blank = begins_with(blanks))
    text.remove_prefix(blank->size());
  const std::initializer_list<std::string_view> formula{"=",  "+",      "-",      "@",      "\t",    "\r",
                                                        "\n", "\uFF1D", "\uFF0B", "\uFF0D", "\uFF20"};
  return begins_with(formula) != formula.end();
}

}  // namespace

Csv::Csv(const http::Request& request, std::string_view columns)
    : digits_(static_cast<int>(request.query_integer("digits").value_or(http::usual_digits))) {
  while (!columns.empty()) {
    const std::string& column = columns_.emplace_back(take_item(columns, ' '));
    const std::string title = column.substr(0, column.find_first_of("=?"));
    field(title.substr(title.rfind('/') + 1));
  }
  end_row();
}

Csv& Csv::field(std::string_view text) {
  separate();
  const bool guarded = may_be_formula(text);
  const bool quoted = text.find_first_of("\",\r\n") != std::string_view::npos;
  if (quoted) text_ += '"';
  if (guarded) text_ += '\'';
  for (const char c : text) text_ += c == '"' ? std::string("\"\"") : std::string(1, c);
  if (quoted) text_ += '"';
  return *this;
}

Csv& Csv::exact(double number) {
  separate();
  if (std::isfinite(number)) text_ += http::number_text(number);
  return *this;
}

Csv& Csv::field(double number) {
  separate();
  if (std::isfinite(number)) text_ += http::rounded(http::number_text(resolved(number)), digits_);
  return *this;
}

Csv& Csv::field(std::int64_t number) {
  separate();
  text_ += std::to_string(number);
  return *this;
}

void Csv::end_row() {
  text_ += "\r\n";
  comma_ = false;
}

void Csv::row(const std::string& item) {
  const auto members = nlohmann::ordered_json::parse(item);
  for (const std::string& column : columns_) {
    const bool asked = column.ends_with('?');
    const std::string path =
        column.substr(column.find('=') + 1).substr(0, asked ? column.size() - 1 : column.npos);
    const auto value =
        members.value(nlohmann::ordered_json::json_pointer("/" + path), nlohmann::ordered_json());
    if (asked)
      field(!value.is_null());
    else if (value.is_boolean())
      field(value.get<bool>());
    else if (value.is_number_integer())
      field(value.get<std::int64_t>());
    else if (value.is_number())
      field(value.get<double>());
    else if (value.is_array())
      field(fmt::format("{}", fmt::join(value.get<std::vector<std::string>>(), " ")));
    else if (value.is_object())
      field(value.dump());
    else
      field(value.is_null() ? "" : value.get<std::string>());
  }
  end_row();
}

http::Response Csv::response(const std::string& name, std::string_view next_cursor) {
  http::Response response;
  response.content_type = "text/csv; charset=utf-8; header=present";
  response.headers.emplace_back("Content-Disposition", "attachment; filename=\"joulecast-" + name + ".csv\"");
  response.body = std::move(text_);
  response.next_cursor = next_cursor;
  return response;
}

}  // namespace joulecast::api
