/// `abbe identify artefact`: makes the calibrator file of a ball array from touches in one position
/// on an accurate machine.

#include <fmt/format.h>

#include <array>
#include <memory>
#include <optional>

#include "abbe/base/text_file.hpp"
#include "abbe/base/units.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/evemu_files.hpp"
#include "abbe/tasks/vector_option.hpp"
#include "commands.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

struct IdentifyArtefactArguments {
  std::string touches, name, out;
  std::string outward_1 = "0,0,1", outward_2 = "0,1,0";
  double tip_radius_mm = 0.0, machine_tip_radius_mm = -1.0;
  std::optional<double> u_touch_um;
};

struct Precalibrated {
  calib::evemu::Calibrator calibrator;
  InputFile source;
  std::size_t touches = 0;
};

Result<Precalibrated> precalibrate(const IdentifyArtefactArguments& arguments) {
  const auto outward_1 = parse_mm("--outward-1", arguments.outward_1),
             outward_2 = parse_mm("--outward-2", arguments.outward_2);
  if (!outward_1 || !outward_2)
    return tl::make_unexpected((outward_1 ? outward_2 : outward_1).error());
  const auto touches = read_touches_csv(arguments.touches);
  ABBE_TRY(touches);
  for (const auto& touch : touches->touches)
    if (touch.position != touches->touches.front().position)
      return fail(
          ErrorCode::BadInput,
          fmt::format("{}: positions {} and {}: an artefact is calibrated in one position",
                      arguments.touches, touches->touches.front().position, touch.position));

  std::optional<double> u_touch_m;
  if (arguments.u_touch_um) u_touch_m = *arguments.u_touch_um / kUmPerM;
  auto calibrator = calib::evemu::precalibrated(arguments.name, touches->touches,
                                                arguments.tip_radius_mm / kMmPerM,
                                                {*outward_1, *outward_2}, u_touch_m);
  if (!calibrator) return tl::make_unexpected(error_of(calibrator.error()));
  if (arguments.machine_tip_radius_mm >= 0.0)
    calibrator->tip_radius_m = arguments.machine_tip_radius_mm / kMmPerM;

  return Precalibrated{std::move(*calibrator), touches->source, touches->touches.size()};
}

/// The comment at the head of the file: the origin of the data, and what the uncertainties do not
/// include.
std::string head_of(const Precalibrated& found) {
  return fmt::format(
      "# from {} touches of one position: {}, SHA-256 {}\n"
      "# u: standard uncertainty (k = 1) of the fits; it does not include the machine's errors\n",
      found.touches, found.source.name, found.source.sha256);
}

int run(const IdentifyArtefactArguments& arguments) {
  const auto found = precalibrate(arguments);
  if (!found) return report(found.error());
  const auto& calibrator = found->calibrator;
  if (const auto written =
          replace_file(arguments.out, calibrator_toml(calibrator, {}, head_of(*found)));
      !written)
    return report(written.error());
  for (const auto& ball : calibrator.balls)
    fmt::print("ball {:<2} radius {:.4f} mm, u = {:.2f} um\n", ball.number, kMmPerM * ball.radius_m,
               kUmPerM * ball.u_m);
  for (const auto& block : calibrator.blocks)
    fmt::print("block {} u = {:.1f} urad\n", block.number, kUmPerM * block.u_rad);
  fmt::print("written {}\n", arguments.out);

  return 0;
}

}  // namespace

void add_identify_artefact(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<IdentifyArtefactArguments>();
  auto* command = parent.add_subcommand(
      "artefact",
      "Make the calibrator file of a ball array from touches in one position on an accurate "
      "machine");
  command
      ->add_option("--touches", arguments->touches,
                   "touches.csv: position,kind,index,x_mm,y_mm,z_mm")
      ->required();
  command->add_option("--name", arguments->name, "name of the artefact")->required();
  command->add_option("--tip-radius-mm", arguments->tip_radius_mm, "tip radius of these touches")
      ->check(CLI::NonNegativeNumber)
      ->required();
  command
      ->add_option("--machine-tip-radius-mm", arguments->machine_tip_radius_mm,
                   "tip radius on the machine to be calibrated; default: that of --tip-radius-mm")
      ->check(CLI::NonNegativeNumber);
  command
      ->add_option(
          "--u-touch-um", arguments->u_touch_um,
          "standard uncertainty of a touch, needed for balls with 4 touches and blocks with 3; "
          "from more touches it is estimated")
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--outward-1", arguments->outward_1,
                   "x,y,z: approximate outward normal of the face of block 1")
      ->capture_default_str();
  command->add_option("--outward-2", arguments->outward_2, "the same for block 2")
      ->capture_default_str();
  command->add_option("-o,--out", arguments->out, "file to write: calibrator.toml")->required();
  command->callback([arguments, &exit] { exit = run(*arguments); });
}

}  // namespace abbe::daemon
