#include "measured_input.hpp"

#include "abbe/base/text_file.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/length_unit.hpp"
#include "abbe/tables/rtl_file.hpp"
#include "abbe/tasks/vector_option.hpp"
#include "argument_checks.hpp"
#include "file_of_program.hpp"

namespace abbe::daemon {
namespace {

std::vector<std::string> missing_for_rtl(const MeasuredOptions& options) {
  std::vector<std::string> missing;
  if (options.error.empty())
    missing.emplace_back("--measured-error EXX, EYY or EZZ: the axis that was measured");
  if (options.line.empty())
    missing.emplace_back(
        "--measured-line-mm X,Y,Z: positions of the other two axes during the measurement (that of "
        "the moving axis has no effect), with the reflector at the tool offset of the model");
  if (options.unit.empty())
    missing.emplace_back(
        "--measured-unit um or mm: the unit of the deviations, as the laser program shows them");
  return missing;
}

Result<MeasuredFile> read_rtl(const MeasuredOptions& options) {
  if (auto missing = missing_for_rtl(options); !missing.empty())
    return tl::make_unexpected(
        needs_options(options.file, "an .rtl file (positioning of one axis)", std::move(missing)));
  ABBE_TRY(require_word("--measured-error", options.error, {"EXX", "EYY", "EZZ"}));
  ABBE_TRY(require_word("--measured-unit", options.unit, {"um", "mm"}));
  const auto line_m = parse_mm("--measured-line-mm", options.line);
  ABBE_TRY(line_m);

  const auto text = read_text(options.file);
  ABBE_TRY(text);
  return parse_rtl(*text, options.file,
                   {.error = options.error,
                    .line_m = *line_m,
                    .metres_per_deviation = metres_per(options.unit).value_or(0.0)});
}

}  // namespace

Result<MeasuredFile> read_measured(const MeasuredOptions& options) {
  if (is_rtl(head_of(options.file))) return read_rtl(options);
  if (!options.error.empty() || !options.line.empty() || !options.unit.empty())
    return tl::make_unexpected(options_without_use(
        options.file, "--measured-error, --measured-line-mm, --measured-unit (of .rtl files)"));
  return read_measured_csv(options.file);
}

}  // namespace abbe::daemon
