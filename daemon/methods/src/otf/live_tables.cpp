#include "abbe/methods/otf/live_tables.hpp"

#include <algorithm>
#include <iterator>
#include <limits>
#include <string>
#include <utility>

#include "abbe/calib/geometry/error_parameters.hpp"
#include "abbe/calib/otf/samples/nest_visits.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/config/calibration_input.hpp"
#include "abbe/methods/otf/inputs.hpp"
#include "abbe/pipeline/environment_use.hpp"
#include "abbe/result/try.hpp"
#include "otf/vector_of.hpp"

namespace abbe::daemon {
namespace {

/// Most corrections of the pose. After two corrections the pose is exact within the noise. If more
/// were needed, the path does not fit, which the identification reports.
constexpr int kMostCorrections = 2;

void append(LiveTable& table, const calib::otf::NodeSoFar& node) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  table.value.push_back(node.determined ? node.value : kNone);
  table.u.push_back(node.determined ? node.u : kNone);
}

LiveTables live_tables(const calib::otf::TablesSoFar& found, const calib::MachineNodes& nodes) {
  LiveTables live{.tables = {}, .samples = found.samples, .variance_factor = found.variance_factor};
  for (const auto& table : found.tables) {
    LiveTable& out =
        live.tables.emplace_back(LiveTable{.name = name(table.motion),
                                           .is_angle = is_rotation(table.motion.motion),
                                           .at_m = nodes[index(table.motion.axis)].nodes_m});
    for (const auto& node : table.nodes) append(out, node);
  }

  for (std::size_t i = 0; i < calib::kSquarenessNames.size(); ++i)
    append(live.tables.emplace_back(
               LiveTable{.name = std::string(calib::kSquarenessNames[i]), .is_angle = true}),
           found.squareness[i]);
  return live;
}

}  // namespace

Result<OtfLiveTables> OtfLiveTables::of(const Config& config) {
  auto machine = otf_machine(config.machine);
  ABBE_TRY(machine);
  auto estimate = calib::otf::RunningEstimate::of({.machine = *machine,
                                                   .noise = otf_noise(config.machine),
                                                   .backlash = calib_of(config.otf.backlash)});
  if (!estimate) return tl::unexpected(error_of(estimate.error()));
  return OtfLiveTables(config, std::move(*machine), std::move(*estimate));
}

OtfLiveTables::OtfLiveTables(const Config& config, calib::otf::Machine machine,
                             calib::otf::RunningEstimate estimate)
    : environment_use_(environment_use(config)),
      nodes_(std::move(machine.nodes)),
      nests_(nest_options(config.otf).nests),
      estimate_(std::move(estimate)) {}

void OtfLiveTables::take(RunNews&& news) {
  std::ranges::move(news.chunks, std::back_inserter(chunks_));
  tail_ = std::move(news.tail);
  environment_ = news.environment;
  for (const LegBegun& leg : news.legs) {
    if (legs_.empty() || legs_.back().first_point != leg.first_point)
      estimate_.add_pair(vector_of(leg.q_m), vector_of(leg.p_tracker_m));
    legs_.push_back(leg);
  }
}

const RunPoint& OtfLiveTables::point(std::size_t i) const {
  const std::size_t chunk = i / RunPoints::kPointsInChunk;
  return chunk < chunks_.size() ? chunks_[chunk][i % RunPoints::kPointsInChunk]
                                : tail_[i - chunks_.size() * RunPoints::kPointsInChunk];
}

void OtfLiveTables::add(const RunPoint& point) {
  const calib::Vector3 p_m = vector_of(point.p_tracker_m);
  const bool at_nest = calib::otf::nest_at(p_m, nests_).has_value();
  if (point.usable && p_m.allFinite() && !at_nest) estimate_.add(p_m);
}

/// Adds the new points to the estimate. The vertices of a leg are corrected by the mean temperature
/// of the scales up to the time at which the leg is added. In contrast, the identification uses the
/// mean over the whole run.
void OtfLiveTables::add_points() {
  const std::size_t end = chunks_.size() * RunPoints::kPointsInChunk + tail_.size();
  for (; next_point_ < end; ++next_point_) {
    while (next_leg_ < legs_.size() && legs_[next_leg_].first_point <= next_point_) {
      const LegBegun& leg = legs_[next_leg_++];
      estimate_.begin_leg(vector_of(at_temperature(leg.from_m, environment_, environment_use_)),
                          vector_of(at_temperature(leg.to_m, environment_, environment_use_)));
    }
    add(point(next_point_));
  }
}

Result<LiveTables> OtfLiveTables::tables() {
  if (estimate_.update_pose()) next_point_ = next_leg_ = 0;
  if (!estimate_.has_pose())
    return fail(ErrorCode::DataInsufficient, "the vertices reached so far do not span a plane");
  add_points();
  estimate_.set_scale(environment_.u_scale, environment_.u_expansion_factor);
  auto found = estimate_.tables();

  for (int i = 0; found && i < kMostCorrections && estimate_.correct_pose(*found); ++i) {
    next_point_ = next_leg_ = 0;
    add_points();
    found = estimate_.tables();
  }

  if (!found) return tl::unexpected(error_of(found.error()));
  return live_tables(*found, nodes_);
}

}  // namespace abbe::daemon
