#pragma once
/// The 21 true errors as a file, so that a machine can be stored, edited by hand and compared with
/// an identified model. CSV `name,position_mm,value,unit`: EXX .. ECZ on ascending nodes (um or
/// urad), A0Z, B0Z, C0Y (urad, position ignored), and `NAME.backlash` (um or urad, position
/// ignored). An error without rows is 0 everywhere.

#include <string>
#include <string_view>

#include "abbe/sim/error.hpp"
#include "abbe/sim/truth_machine.hpp"

namespace abbe::sim {

/// Replaces errors, squareness and backlash of `into`; order, ranges and target stay. `name` is
/// the file name in error texts.
[[nodiscard]] Result<TruthMachine> parse_truth_csv(std::string_view text, std::string_view name,
                                                   TruthMachine into, Shape shape);
[[nodiscard]] std::string format_truth_csv(const TruthMachine& truth);

}  // namespace abbe::sim
