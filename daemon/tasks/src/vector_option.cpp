#include "abbe/tasks/vector_option.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "abbe/base/units.hpp"

namespace abbe::daemon {

Result<calib::Vector3> parse_mm(const std::string& option, const std::string& text) {
  const auto malformed = [&] {
    return fail(ErrorCode::Usage, fmt::format("{} \"{}\": must be x,y,z in mm", option, text));
  };

  calib::Vector3 vector_m = calib::Vector3::Zero();
  const char* at = text.data();
  const char* const end = at + text.size();

  for (int i = 0; i < 3; ++i) {
    double value_mm = 0.0;
    const auto [next, fault] = std::from_chars(at, end, value_mm);
    if (fault != std::errc{} || !std::isfinite(value_mm)) return malformed();
    vector_m[i] = value_mm / kMmPerM;
    at = next;
    if (i < 2 && (at == end || *at++ != ',')) return malformed();
  }

  if (at != end) return malformed();
  return vector_m;
}

Result<calib::Vector3> tool_of(const std::string& text, const calib::VolumetricModel& model) {
  calib::Vector3 tool_m = model.tool_offsets_m().front();
  if (!text.empty()) {
    auto given = parse_mm("--tool-mm", text);
    if (!given) return given;
    tool_m = *given;
  }
  if (!model.holds_for_tool(tool_m))
    return fail(
        ErrorCode::DataInsufficient,
        fmt::format(
            "tool offset ({:.6g}, {:.6g}, {:.6g}) mm: the model was identified with another tool "
            "offset and is not valid for it",
            tool_m[0] * kMmPerM, tool_m[1] * kMmPerM, tool_m[2] * kMmPerM));
  return tool_m;
}

}  // namespace abbe::daemon
