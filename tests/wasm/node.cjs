// node node.cjs MODULE JOB BLOB: prints what the job found, as JSON.
const { readFileSync } = require("node:fs");
const { runJob } = require("./executor.js");

const [module_, job, blob] = process.argv.slice(2).map((name) => readFileSync(name));
runJob(module_, JSON.parse(job), blob).then((found) => process.stdout.write(JSON.stringify(found)));
