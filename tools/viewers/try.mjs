// Opens a baked file with three.js in headless Chromium, takes a screenshot, and compares it with photonmill's own picture:
//
//   npm install --prefix tools/viewers
//   photonmill bake scene.glb -o baked && photonmill render scene.glb --size 256x256 -o scene.exr
//   node tools/viewers/try.mjs baked scene.glb shot.png scene.exr
//
// It prints the share of the picture's light that is shown, and by how much the worst of 8 x 8 blocks is off. CHROMIUM names another browser.
import { createServer } from "node:http";
import { readFile } from "node:fs/promises";
import { dirname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";
import puppeteer from "puppeteer-core";

const [folder, name, shot, picture] = process.argv.slice(2);
if (!shot) throw new Error("usage: node try.mjs FOLDER FILE.glb SHOT.png [PICTURE.exr]");
const SIZE = 256;
const here = dirname(fileURLToPath(import.meta.url));
const types = { html: "text/html", js: "text/javascript" };
const server = createServer(async (request, response) => {
  const path = normalize(decodeURIComponent(new URL(request.url, "http://a").pathname));
  const place = path === "/picture" ? picture : path.startsWith("/baked/") ? join(folder, path.slice(7)) : join(here, path);
  try {
    const content = await readFile(place);
    response.writeHead(200, { "content-type": types[place.split(".").pop()] ?? "application/octet-stream" }).end(content);
  } catch {
    response.writeHead(404).end();
  }
}).listen(0, "127.0.0.1");
const args = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
const browser = await puppeteer.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args });
try {
  const page = await browser.newPage();
  page.on("pageerror", (error) => console.error(String(error)));
  await page.setViewport({ width: SIZE, height: SIZE });
  const asked = new URLSearchParams({ name, size: SIZE, picture: picture ?? "" });
  await page.goto(`http://127.0.0.1:${server.address().port}/page.html?${asked}`);
  await page.waitForFunction("window.result", { timeout: 120_000 });
  const result = await page.evaluate("window.result");
  if (result.error) throw new Error(result.error);
  await page.screenshot({ path: shot });
  console.log(`share of the light ${result.share.toFixed(4)}, worst block ${(100 * result.worst).toFixed(1)} % off`);
} finally {
  await browser.close();
  server.close();
}
