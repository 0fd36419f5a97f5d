// Inserts the scans of a file into MRPT's occupancy grid and prints the time of each, in ns.
// Usage: mrpt_insert SCANS WIDENING(0|1) ROUNDS; see scripts/bench_map.py for the file's form.
#include <mrpt/maps/COccupancyGridMap2D.h>
#include <mrpt/obs/CObservation2DRangeScan.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <vector>

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  std::ifstream file(argv[1], std::ios::binary);
  double head[8];  // scans, beams, aperture, range, resolution, half extent, p_hit, p_miss
  file.read(reinterpret_cast<char*>(head), sizeof head);
  const auto scans = static_cast<size_t>(head[0]), beams = static_cast<size_t>(head[1]);

  mrpt::maps::COccupancyGridMap2D map(-head[5], head[5], -head[5], head[5], head[4]);
  map.insertionOptions.maxDistanceInsertion = head[3];
  map.insertionOptions.maxOccupancyUpdateCertainty = head[6];
  map.insertionOptions.maxFreenessUpdateCertainty = head[7];
  map.insertionOptions.considerInvalidRangesAsFreeSpace = true;
  map.insertionOptions.wideningBeamsWithDistance = std::atoi(argv[2]) != 0;

  std::vector<mrpt::obs::CObservation2DRangeScan> read(scans);
  std::vector<mrpt::poses::CPose3D> poses(scans);
  std::vector<float> ranges(beams);
  for (size_t i = 0; i < scans; ++i) {
    double pose[3];
    file.read(reinterpret_cast<char*>(pose), sizeof pose);
    file.read(reinterpret_cast<char*>(ranges.data()), sizeof(float) * beams);
    if (!file) return 1;
    poses[i] = mrpt::poses::CPose3D(mrpt::poses::CPose2D(pose[0], pose[1], pose[2]));
    read[i].aperture = head[2];
    read[i].maxRange = head[3];
    read[i].rightToLeft = true;
    read[i].resizeScan(beams);
    for (size_t k = 0; k < beams; ++k) {
      read[i].setScanRange(k, ranges[k]);
      read[i].setScanRangeValidity(k, ranges[k] < head[3]);
    }
  }
  for (int round = std::atoi(argv[3]); round > 0; --round)
    for (size_t i = 0; i < scans; ++i) {
      const auto from = std::chrono::steady_clock::now();
      map.insertObservation(read[i], poses[i]);
      const std::chrono::duration<double, std::nano> took =
          std::chrono::steady_clock::now() - from;
      std::printf("%.0f\n", took.count());
    }
  return 0;
}
