#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace joulecast::report {

// Sections of a page with its style sheet around them.
class Page {
 public:
  Page(std::string title, std::string kicker, std::string verdict);

  struct Figure {
    std::string value, label;
  };
  void figures(std::span<const Figure> figures);

  // Opens a section; what follows belongs to it.
  void section(std::string_view heading, std::string_view introduction = {});
  void paragraph(std::string_view html);                 // markup of our own; escape all other text
  void card(std::string_view html, bool warns = false);  // the same in a frame
  void chart(std::string_view svg, std::string_view caption = {});
  void wide_chart(std::string_view svg);  // scrolls sideways on a narrow screen
  void charts(std::span<const std::pair<std::string, std::string>> svg_and_caption);
  void list(std::span<const std::string> items);  // escaped here
  // Cells are markup of our own; columns from `first_number` on are aligned right.
  void table(std::span<const std::string> header, std::span<const std::vector<std::string>> rows,
             std::size_t first_number);
  void legend(std::span<const std::pair<std::string, std::string>> style_and_text);

  std::string str() const;

 private:
  std::string body_;
  bool open_ = false;
  std::string title_;
};

}  // namespace joulecast::report
