#include "abbe/exports/prove_export.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "abbe/base/units.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

Error different(const FormatFacts& facts, const calib::Vector3& p_m, const calib::Vector3& file_m,
                const calib::Vector3& held_m) {
  const auto um = [](const calib::Vector3& v_m) {
    const calib::Vector3 v = kUmPerM * v_m;
    return fmt::format("({:.6f}, {:.6f}, {:.6f}) um", v[0], v[1], v[2]);
  };
  const bool opposite = (file_m + held_m).norm() < 0.01 * held_m.norm();
  return {ErrorCode::Refused,
          fmt::format("{}: the file, read as the control does, corrects by {} at ({:.3f}, {:.3f}, "
                      "{:.3f}) mm instead of {}{}",
                      facts.name, um(file_m), p_m[0] * kMmPerM, p_m[1] * kMmPerM, p_m[2] * kMmPerM,
                      um(held_m), opposite ? ": the sign is opposite" : "")};
}

}  // namespace

Result<ExportProof> prove_export(ExportFormat format, std::span<const ExportFile> files,
                                 const ControlSettings& settings,
                                 std::span<const calib::ExportPlace> places,
                                 const calib::CorrectionFunction& held) {
  const auto control = read_as_control(format, files, settings);
  ABBE_TRY(control);

  ExportProof proof{places.size(), 0.0};
  for (const calib::ExportPlace& place : places) {
    const auto& p = place.commanded_m;
    std::array<int, 3> direction{};
    for (std::size_t a = 0; a < 3; ++a) direction[a] = static_cast<int>(place.travel[a]);
    const AxisPosition c = (*control)({p[0], p[1], p[2]}, direction);

    const calib::Vector3 file_m(c[0], c[1], c[2]), held_m = held(place);
    const double difference_m = (file_m - held_m).cwiseAbs().maxCoeff();
    if (!(difference_m <= kExportTolerance_m))
      return tl::make_unexpected(different(facts_of(format), p, file_m, held_m));
    proof.largest_difference_m = std::max(proof.largest_difference_m, difference_m);
  }
  return proof;
}

}  // namespace abbe::daemon
