// Runs MRPT's Rao-Blackwellised SLAM, as its `rbpf-slam` does, over the scans of a file. Writes the
// seconds that it took, then of each update the number of its scan and the pose, x y yaw, from the
// path of the most likely particle at the end.
// Usage: mrpt_slam CONFIG.ini FILE OUT; see scripts/bench_slam.py for the file's form.
#include <mrpt/config/CConfigFile.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/random/RandomGenerators.h>
#include <mrpt/slam/CMetricMapBuilderRBPF.h>

#include <chrono>
#include <cstdio>
#include <deque>
#include <fstream>
#include <vector>

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  std::ifstream file(argv[2], std::ios::binary);
  double head[5];  // scans, beams, aperture, middle, range
  file.read(reinterpret_cast<char*>(head), sizeof head);
  const auto scans = static_cast<size_t>(head[0]), beams = static_cast<size_t>(head[1]);

  mrpt::slam::CMetricMapBuilderRBPF::TConstructionOptions how;
  how.loadFromConfigFile(mrpt::config::CConfigFile(argv[1]), "MappingApplication");
  how.verbosity_level = mrpt::system::LVL_ERROR;
  mrpt::slam::CMetricMapBuilderRBPF builder(how);
  builder.setVerbosityLevel(mrpt::system::LVL_ERROR);
  mrpt::random::getRandomGenerator().randomize(1);
  const auto length = [&] { return builder.mapPDF.m_particles.front().d->robotPath.size(); };

  mrpt::obs::CActionRobotMovement2D::TMotionModelOptions motion;
  motion.modelSelection = mrpt::obs::CActionRobotMovement2D::mmGaussian;
  mrpt::poses::CPose2D last;
  std::vector<size_t> updates(length(), 0);
  std::vector<float> ranges(beams);
  double seconds = 0;
  for (size_t i = 0; i < scans; ++i) {
    double pose[3];
    file.read(reinterpret_cast<char*>(pose), sizeof pose);
    file.read(reinterpret_cast<char*>(ranges.data()), sizeof(float) * beams);
    if (!file) return 1;
    const mrpt::poses::CPose2D now(pose[0], pose[1], pose[2]);
    auto scan = mrpt::obs::CObservation2DRangeScan::Create();
    scan->timestamp = mrpt::Clock::fromDouble(1e9 + static_cast<double>(i));
    scan->aperture = static_cast<float>(head[2]);
    scan->maxRange = static_cast<float>(head[4]);
    scan->setSensorPose(mrpt::poses::CPose3D(0, 0, 0, head[3], 0, 0));
    scan->rightToLeft = true;
    scan->resizeScan(beams);
    for (size_t k = 0; k < beams; ++k) {
      scan->setScanRange(k, ranges[k]);
      scan->setScanRangeValidity(k, ranges[k] < head[4]);
    }
    mrpt::obs::CActionRobotMovement2D moved;
    moved.timestamp = scan->timestamp;
    moved.computeFromOdometry(i == 0 ? mrpt::poses::CPose2D() : now - last, motion);
    last = now;
    mrpt::obs::CActionCollection actions;
    actions.insert(moved);
    mrpt::obs::CSensoryFrame seen;
    seen.insert(scan);
    const auto from = std::chrono::steady_clock::now();
    builder.processActionObservation(actions, seen);
    seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - from).count();
    while (updates.size() < length()) updates.push_back(i);
  }
  std::deque<mrpt::math::TPose3D> path;
  builder.getCurrentMostLikelyPath(path);
  std::FILE* out = std::fopen(argv[3], "w");
  if (!out) return 1;
  std::fprintf(out, "%.3f\n", seconds);
  for (size_t k = 0; k < path.size() && k < updates.size(); ++k)
    std::fprintf(out, "%zu %.6f %.6f %.6f\n", updates[k], path[k].x, path[k].y, path[k].yaw);
  return std::fclose(out) == 0 ? 0 : 1;
}
