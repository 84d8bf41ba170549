// LinuxCNC: loader of src/emc/usr_intf/usrmotintf.cc, use in src/emc/motion/control.c.
#include <fmt/format.h>

#include "abbe/result/try.hpp"
#include "control_tables.hpp"

namespace abbe::daemon {
namespace {

constexpr std::size_t kMostTriplets = 256;  ///< EMCMOT_COMP_SIZE

struct JointTrim {
  std::vector<TablePoint> forward, reverse;
};

/// Reads a file as LinuxCNC does: its loader ends without a message at the first line that is not
/// three numbers.
Result<JointTrim> read_joint(const ExportFile& file) {
  JointTrim trim;
  for (const TextLine& line : lines_of(file.text, "")) {
    const auto words = words_of(line.text);
    std::vector<double> row;
    for (const auto word : words) {
      if (const auto value = plain_number(word)) row.push_back(*value);
    }
    if (words.size() != 3 || row.size() != 3)
      return at_line(file.name, line.number,
                     "not three numbers: LinuxCNC ends reading here without a message");
    if (trim.forward.size() == kMostTriplets)
      return at_line(file.name, line.number, "more than 256 rows");
    trim.forward.push_back({row[0], row[1]});
    trim.reverse.push_back({row[0], row[2]});
  }
  if (const auto fault = table_fault(trim.forward); !fault.empty())
    return at_line(file.name, trim.forward.size(), fault);
  return trim;
}

/// The correction in mm: for a direction of travel, or the mean of both directions for direction 0.
double trim_mm(const JointTrim& joint, double position_mm, int direction) {
  const double forward = on_table(joint.forward, position_mm);
  const double reverse = on_table(joint.reverse, position_mm);
  if (direction == 0) return 0.5 * (forward + reverse);
  return direction > 0 ? forward : reverse;
}

}  // namespace

Result<ControlCorrection> read_linuxcnc(std::span<const ExportFile> files) {
  if (files.size() != 3)
    return fail(
        ErrorCode::BadInput,
        fmt::format("linuxcnc-comp: {} files instead of one for each of X, Y and Z", files.size()));
  std::array<JointTrim, 3> joints;
  for (std::size_t a = 0; a < 3; ++a) {
    auto joint = read_joint(files[a]);
    ABBE_TRY(joint);
    joints[a] = *std::move(joint);
  }

  return [joints](const AxisPosition& commanded_m, const std::array<int, 3>& direction) {
    AxisPosition c_m{};
    for (std::size_t a = 0; a < 3; ++a)
      c_m[a] = trim_mm(joints[a], commanded_m[a] * 1000.0, direction[a]) / 1000.0;
    return c_m;
  };
}

}  // namespace abbe::daemon
