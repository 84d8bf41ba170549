#include "abbe/tables/evemu_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <nlohmann/json.hpp>

#include "abbe/base/json_text.hpp"
#include "abbe/base/parsed_table.hpp"
#include "abbe/base/sha256.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/base/units.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/config/calibration_input.hpp"
#include "abbe/result/try.hpp"
#include "abbe/settings/bounded_toml.hpp"
#include "abbe/settings/section.hpp"
#include "expansivity.hpp"
#include "whole_number.hpp"

namespace abbe::daemon {

namespace {

calib::Vector3 vector_at(const NumberTable& table, std::size_t row, std::size_t first,
                         double per_m) {
  return {table.at(row, first) / per_m, table.at(row, first + 1) / per_m,
          table.at(row, first + 2) / per_m};
}

void read_balls(Section& root, calib::evemu::Calibrator& out) {
  for (Section& ball : root.children("ball")) {
    calib::evemu::Calibrator::Ball b;
    ball.get_integer("number", b.number, 1, kMostNumber, Need::Required);
    ball.get("x_mm", b.centre_m.x(), kMilli, kAny, Need::Required);
    ball.get("y_mm", b.centre_m.y(), kMilli, kAny, Need::Required);
    ball.get("z_mm", b.centre_m.z(), kMilli, kAny, Need::Required);
    ball.get("radius_mm", b.radius_m, kMilli, kPositive, Need::Required);
    ball.get("u_um", b.u_m, kMicro, kNotNegative);
    ball.close();
    out.balls.push_back(b);
  }

  std::sort(out.balls.begin(), out.balls.end(),
            [](const auto& a, const auto& b) { return a.number < b.number; });
}

void read_face(Section& block, std::optional<BlockFace>& out) {
  BlockFace face;
  unsigned known = 0;
  known += block.get("x_mm", face.centre_m.x(), kMilli, kAny) ? 1 : 0;
  known += block.get("y_mm", face.centre_m.y(), kMilli, kAny) ? 1 : 0;
  known += block.get("z_mm", face.centre_m.z(), kMilli, kAny) ? 1 : 0;
  block.get("half_size_mm", face.half_size_m, kMilli, kPositive);
  if (known == 3) out = face;
  if (known == 1 || known == 2) block.fault("x_mm", "needs x_mm, y_mm and z_mm together");
}

void read_blocks(Section& root, calib::evemu::Calibrator& out,
                 std::array<std::optional<BlockFace>, 2>& faces) {
  for (Section& block : root.children("block")) {
    calib::evemu::Calibrator::Block b;
    block.get_integer("number", b.number, 1, 2, Need::Required);
    get_vector(block, "normal", b.normal, kPlain, Need::Required);
    block.get("u_urad", b.u_rad, kMicro, kNotNegative);
    read_face(block, faces[b.number == 2 ? 1 : 0]);
    block.close();
    out.blocks.push_back(b);
  }

  std::sort(out.blocks.begin(), out.blocks.end(),
            [](const auto& a, const auto& b) { return a.number < b.number; });
}

calib::evemu::Calibrator read_calibrator(Section& root,
                                         std::array<std::optional<BlockFace>, 2>& faces) {
  calib::evemu::Calibrator out;
  Section head = root.child("calibrator", Need::Required);
  head.get("name", out.name, Need::Required);
  head.get("tip_radius_mm", out.tip_radius_m, kMilli, kNotNegative, Need::Required);
  read_expansivity(head, out.expansivity);
  head.close();
  read_balls(root, out);
  read_blocks(root, out, faces);
  root.close();
  return out;
}

}  // namespace

Result<TouchesFile> read_touches_csv(const std::filesystem::path& file) {
  auto parsed = parse_table(
      file,
      {{{"position"}, {"kind", true, {"ball", "block"}}, {"index"}, {"x_mm"}, {"y_mm"}, {"z_mm"}}});
  ABBE_TRY(parsed);
  check_rows(*parsed, 1, "touches");
  auto& [source, table, faults] = *parsed;
  TouchesFile out{source, {}, {}};
  std::map<std::array<double, 6>, std::size_t> lines;

  for (std::size_t row = 0; row < table.rows(); ++row) {
    std::array<double, 6> cells{};
    for (std::size_t column = 0; column < cells.size(); ++column)
      cells[column] = table.at(row, column);
    const auto [first, is_new] = lines.emplace(cells, table.line(row));
    if (!is_new && table.sound(row))
      faults.add_kind(
          "repeated", table.line(row), 1, "",
          fmt::format("repeats line {} in every digit: a copy of the row, or two touches of "
                      "one point on a coarse display; delete one of the rows",
                      first->second));
    out.lines.push_back(table.line(row));
    out.touches.push_back({.position = number_at(table, row, 0, "position", faults),
                           .feature = table.at(row, 1) < 0.5 ? calib::evemu::Feature::Ball
                                                             : calib::evemu::Feature::Block,
                           .number = number_at(table, row, 2, "index", faults),
                           .p_m = vector_at(table, row, 3, kMmPerM)});
  }

  if (faults.any()) return tl::make_unexpected(faults.to_error());
  return out;
}

Result<BallErrorsFile> read_errors_csv(const std::filesystem::path& file) {
  const auto text = read_text(file);
  ABBE_TRY(text);
  return parse_errors_csv(*text, file);
}

Result<BallErrorsFile> parse_errors_csv(std::string_view text, const std::filesystem::path& file) {
  auto parsed = parse_table(
      text, file,
      {{{"position"}, {"ball"}, {"x_mm"}, {"y_mm"}, {"z_mm"}, {"ex_um"}, {"ey_um"}, {"ez_um"}}});
  ABBE_TRY(parsed);
  check_rows(*parsed, 1, "errors");
  auto& [source, table, faults] = *parsed;
  BallErrorsFile out{source, {}, {}};

  for (std::size_t row = 0; row < table.rows(); ++row) {
    out.lines.push_back(table.line(row));
    out.errors.push_back({.position = number_at(table, row, 0, "position", faults),
                          .ball = number_at(table, row, 1, "ball", faults),
                          .reading_m = vector_at(table, row, 2, kMmPerM),
                          .V_m = vector_at(table, row, 5, kUmPerM)});
  }

  if (faults.any()) return tl::make_unexpected(faults.to_error());
  return out;
}

Result<CalibratorFile> read_calibrator_toml(const std::filesystem::path& file) {
  const auto text = read_text(file);
  ABBE_TRY(text);
  return parse_calibrator_toml(*text, file);
}

Result<CalibratorFile> parse_calibrator_toml(std::string_view text,
                                             const std::filesystem::path& file) {
  const auto table = parse_toml(text, file.string());
  ABBE_TRY(table);
  Faults faults(file.string());
  Section root(&*table, "", {1, 1}, faults);
  std::array<std::optional<BlockFace>, 2> faces;
  auto calibrator = read_calibrator(root, faces);
  if (faults.any()) return tl::make_unexpected(faults.to_error());
  if (const auto valid = calib::evemu::check(calibrator); !valid)
    return fail(ErrorCode::BadInput, fmt::format("{}: {}", file.string(), valid.error().text));

  return CalibratorFile{{file.filename().string(), sha256_hex(text)}, std::move(calibrator), faces};
}

std::string calibrator_toml(const calib::evemu::Calibrator& calibrator,
                            const std::array<std::optional<BlockFace>, 2>& faces,
                            std::string_view comment) {
  const auto position = [](const calib::Vector3& p_m) {
    return fmt::format("x_mm = {:.17g}\ny_mm = {:.17g}\nz_mm = {:.17g}\n", kMmPerM * p_m.x(),
                       kMmPerM * p_m.y(), kMmPerM * p_m.z());
  };

  std::string out{comment};
  out += fmt::format("[calibrator]\nname = {}\ntip_radius_mm = {:.17g}\n",
                     json_text(nlohmann::json(calibrator.name)), kMmPerM * calibrator.tip_radius_m);
  if (const auto& expansivity = calibrator.expansivity)
    out += fmt::format("alpha_um_per_m_K = {:.17g}\nu_alpha_um_per_m_K = {:.17g}\n",
                       kUmPerM * expansivity->alpha_per_K, kUmPerM * expansivity->u_alpha_per_K);

  for (const auto& ball : calibrator.balls) {
    out +=
        fmt::format("\n[[ball]]\nnumber = {}\n{}radius_mm = {:.17g}\nu_um = {:.3g}\n", ball.number,
                    position(ball.centre_m), kMmPerM * ball.radius_m, kUmPerM * ball.u_m);
  }

  for (const auto& block : calibrator.blocks) {
    const auto& n = block.normal;
    out += fmt::format(
        "\n[[block]]\nnumber = {}\nnormal = [{:.17g}, {:.17g}, {:.17g}]\nu_urad = {:.3g}\n",
        block.number, n.x(), n.y(), n.z(), 1e6 * block.u_rad);
    if (const auto& face = faces[block.number == 2 ? 1 : 0])
      out += fmt::format("{}half_size_mm = {:.17g}\n", position(face->centre_m),
                         kMmPerM * face->half_size_m);
  }

  return out;
}

Result<calib::evemu::Machine> evemu_machine(const MachineConfig& machine) {
  const auto chain = calib::KinematicChain::parse(machine.chain);
  if (!chain) return tl::make_unexpected(error_of(chain.error()));
  const auto& t = machine.target_offset_m;
  return calib::evemu::Machine{*chain, {t[0], t[1], t[2]}};
}

}  // namespace abbe::daemon
