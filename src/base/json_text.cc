#include "base/json_text.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

namespace joulecast {
namespace {

using Json = nlohmann::json;

// A hint for a text with a NaN or an infinity, which JSON does not have: "; JSON has no NaN: ...". `byte` is
// where the parser stopped, counted from 1. Empty for any other fault.
std::string not_finite_hint(std::string_view text, std::size_t byte) {
  constexpr std::array<std::string_view, 3> words{"nan", "infinity", "inf"};
  constexpr std::size_t furthest = 2;  // a parser that takes it for "null" notices a letter later
  const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
  for (std::size_t back = 1; back <= furthest && back <= byte; ++back) {
    for (const std::string_view word : words) {
      if (byte - back > text.size()) continue;
      const std::string_view here = text.substr(byte - back, word.size());
      if (here.size() < word.size() ||
          !std::equal(word.begin(), word.end(), here.begin(), [&](char a, char b) { return a == lower(b); }))
        continue;
      return "; JSON has no " + std::string(word == "nan" ? "NaN" : "Infinity") +
             ": write null for an unknown number, or leave it out";
    }
  }
  return {};
}

// Builds the value from parser events, since repeated keys are visible only there.
class StrictBuilder : public nlohmann::json_sax<Json> {
 public:
  StrictBuilder(Json& root, std::string_view text, std::size_t max_depth)
      : root_(root), text_(text), max_depth_(max_depth) {}

  bool null() override { return add(Json(nullptr)) != nullptr; }
  bool boolean(bool value) override { return add(Json(value)) != nullptr; }
  bool number_integer(number_integer_t value) override { return add(Json(value)) != nullptr; }
  bool number_unsigned(number_unsigned_t value) override { return add(Json(value)) != nullptr; }
  bool number_float(number_float_t value, const string_t&) override { return add(Json(value)) != nullptr; }
  bool string(string_t& value) override { return add(Json(std::move(value))) != nullptr; }
  bool binary(binary_t&) override { return false; }
  bool start_object(std::size_t) override { return open(Json::object()); }
  bool start_array(std::size_t) override { return open(Json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }
  bool key(string_t& name) override {
    auto [place, inserted] = open_.back()->get_ref<Json::object_t&>().emplace(name, nullptr);
    if (!inserted) {
      error_ = Error{Fault::invalid, (pointer(open_.size() - 1) / name).to_string(),
                     "the key is given more than once"};
      return false;
    }
    slot_ = &place->second;
    names_.back() = name;
    return true;
  }
  bool parse_error(std::size_t position, const std::string&,
                   const nlohmann::detail::exception& cause) override {
    // nlohmann's text is "[json.exception...] parse error at line 1, column 5: syntax error ..."
    std::string text = cause.what();
    const auto start = text.find("] ");
    if (start != std::string::npos) text.erase(0, start + 2);
    constexpr int out_of_range = 406;  // of nlohmann: a number beyond those of a double
    const std::string hint = cause.id == out_of_range ? "; must be finite" : not_finite_hint(text_, position);
    error_ = Error{Fault::invalid, hint.empty() ? "" : pointer(open_.size()).to_string(),
                   "malformed JSON at byte " + std::to_string(position) + ": " + text + hint};
    return false;
  }

  std::optional<Error> take_error() { return std::exchange(error_, std::nullopt); }

 private:
  Json* add(Json&& value) {
    if (open_.empty()) {
      root_ = std::move(value);
      return &root_;
    }
    if (open_.back()->is_array()) {
      auto& array = open_.back()->get_ref<Json::array_t&>();
      array.push_back(std::move(value));
      return &array.back();
    }
    *slot_ = std::move(value);
    return slot_;
  }
  bool open(Json&& container) {
    if (open_.size() >= max_depth_) {
      error_ = Error{Fault::invalid, pointer(open_.size()).to_string(),
                     "nested deeper than " + std::to_string(max_depth_) + " levels"};
      return false;
    }
    open_.push_back(add(std::move(container)));
    names_.emplace_back();
    return true;
  }
  bool close() {
    open_.pop_back();
    names_.pop_back();
    return true;
  }
  // To the present or next value in the given number of open containers, outermost first.
  Json::json_pointer pointer(std::size_t levels) const {
    Json::json_pointer path;
    for (std::size_t k = 0; k < levels; ++k) {
      // A container that is open counts already among its array's elements.
      const bool holds_next = k + 1 < open_.size();
      if (open_[k]->is_array()) {
        path /= open_[k]->size() - (holds_next ? 1 : 0);
      } else {
        path /= names_[k];
      }
    }
    return path;
  }

  Json& root_;
  std::string_view text_;
  std::size_t max_depth_;
  std::vector<Json*> open_;  // containers being filled, outermost first; stable: only the last one grows
  std::vector<std::string> names_;  // the key being filled in each, empty for arrays
  Json* slot_ = nullptr;
  std::optional<Error> error_;
};

}  // namespace

Result<Json> parse_json(std::string_view text, std::size_t max_depth) {
  Json value;
  StrictBuilder builder(value, text, max_depth);
  if (Json::sax_parse(text.begin(), text.end(), &builder)) return value;
  auto error = builder.take_error();
  return tl::unexpected<Error>(error ? *error : Error{Fault::invalid, "", "malformed JSON"});
}

}  // namespace joulecast
