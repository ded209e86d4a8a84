#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "gap/diagnosis.h"
#include "gap/report.h"

// The parts that reports share.
namespace joulecast::gap {

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
  void paragraph(std::string_view html);  // markup of our own; escape what comes from elsewhere
  void card(std::string_view html);       // the same in a frame
  void chart(std::string_view svg, std::string_view caption = {});
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

// The effects found, each with what it means, how strong it is and what it cannot be told from.
// `cost_w_or_j` is what each adds on average, with its unit; empty: not shown.
void effects_section(Page& page, std::span<const DiagnosedEffect> effects,
                     std::span<const std::string> costs);
void origin_section(Page& page, const ReportOrigin& origin, const robot::RobotModel& robot);

}  // namespace joulecast::gap
